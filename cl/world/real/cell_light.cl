// Change of light on static surfaces between two frames of a video (iprt/world/real/cell_light.py).
//
//   kernel         in                              out
//   sample_light   radiance, inverse (inverse.cl)  samples: every step-th texel of every step-th
//                                                  row: rgb, inverse depth
//   compare_light  samples of both frames          per cell, sums over samples whose surface stayed

// Relative difference of distances up to which a sample shows the same surface.
#define SAME_DISTANCE 0.02f

__kernel void sample_light(
    const int width,                            // of the panorama
    const int step,
    const int sample_columns,
    const int sample_rows,
    __global const float *restrict radiance,    // 3 a texel
    __global const float *restrict inverse,
    __global const int4 *restrict lines,
    __global float4 *restrict samples)          // out
{
    const int column = get_global_id(0), row = get_global_id(1);
    if (column >= sample_columns || row >= sample_rows)
        return;
    const int x = column * step, y = row * step;
    samples[row * sample_columns + column] =
        (float4)(vload3(y * width + x, radiance), fabs(inverse[lines[y].x + x]));
}

// Return the first of `size` samples, `step` texels apart, in a cell; `cells` cells over `texels` texels.
static inline int first_of(int cell, int cells, int texels, int step)
{
    const int texel = (cell * texels + cells - 1) / cells;
    return (texel + step - 1) / step;
}

__kernel void compare_light(
    const int columns,                          // of cells
    const int rows,
    const int width,
    const int height,
    const int step,
    const int sample_columns,
    __global const float4 *restrict before,
    __global const float4 *restrict now,
    __global float4 *restrict lights)           // out, 2 a cell: rgb before, count; rgb now, 0
{
    const int column = get_global_id(0), row = get_global_id(1);
    if (column >= columns || row >= rows)
        return;
    const int x0 = first_of(column, columns, width, step);
    const int x1 = first_of(column + 1, columns, width, step);
    const int y0 = first_of(row, rows, height, step), y1 = first_of(row + 1, rows, height, step);
    float4 first = (float4)(0.0f), second = (float4)(0.0f);
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++) {
            const float4 a = before[y * sample_columns + x], b = now[y * sample_columns + x];
            // Both are 0 in open sky.
            if (a.w > 0.0f && b.w > 0.0f && fabs(b.w - a.w) <= SAME_DISTANCE * a.w) {
                first += (float4)(a.xyz, 1.0f);
                second += (float4)(b.xyz, 0.0f);
            }
        }
    const int cell = row * columns + column;
    lights[2 * cell] = first;
    lights[2 * cell + 1] = second;
}
