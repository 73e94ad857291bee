// Change of light on static surfaces between two frames of a video (iprt/world/real/cell_light.py).
//
//   kernel         in                              out
//   sample_light   radiance, inverse (inverse.cl)  samples: every step-th texel of every step-th
//                                                  row: rgb, inverse depth
//   relight_cells  samples of both frames          cells of the irradiance cache (irradiance.cl) in the
//                                                  new light
//
// The radiance of a diffuse surface is proportional to its irradiance, so both change by one factor. It is
// measured on texels whose surface stayed.
#include "maths/maths.h"
#include "world/real/irradiance.h"

// Relative difference of distances up to which a sample shows the same surface.
#define SAME_DISTANCE 0.02f
// Share of a change that may have other causes than light: highlights, screens, noise.
#define DISTRUST 0.5f
// Least relative error of a cell's irradiance that limits its number of samples.
#define LEAST_ERROR 1e-4f

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

// Multiply the irradiance and the flux of an entry by a change of light.
static inline void relight(__global float4 *grid, int entry, int entries, float3 factor)
{
    const float4 light = grid[entry], flux = grid[entries + entry];
    const float3 lit = light.xyz * factor;
    const float scale = luminance(lit) / fmax(luminance(light.xyz), 1e-30f);
    grid[entry] = (float4)(lit, light.w);
    grid[entries + entry] = (float4)(flux.xyz * scale, flux.w);
}

__kernel void relight_cells(
    const int columns,                          // of cells
    const int rows,
    const int width,
    const int height,
    const int step,
    const int sample_columns,
    const float dark,                           // radiance below which a cell is only noise
    const float changed,                        // relative error where it is too dark to measure
    __global const float4 *restrict before,
    __global const float4 *restrict now,
    __global float4 *restrict plane,            // in, out: w
    __global float4 *restrict mean,             // in, out
    __global float4 *restrict smooth)           // in, out
{
    const int column = get_global_id(0), row = get_global_id(1);
    if (column >= columns || row >= rows)
        return;
    const int cells = rows * columns, entries = CACHE_SURFACES * cells, cell = row * columns + column;
    int known = 0;
    for (int i = 0; i < CACHE_SURFACES; i++)
        known |= mean[cell + i * cells].w > 0.0f || smooth[cell + i * cells].w > 0.0f;
    if (!known)
        return;
    const int x0 = first_of(column, columns, width, step);
    const int x1 = first_of(column + 1, columns, width, step);
    const int y0 = first_of(row, rows, height, step), y1 = first_of(row + 1, rows, height, step);
    float4 sum = (float4)(0.0f), other = (float4)(0.0f);
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++) {
            const float4 a = before[y * sample_columns + x], b = now[y * sample_columns + x];
            // Both are 0 in open sky.
            if (a.w > 0.0f && b.w > 0.0f && fabs(b.w - a.w) <= SAME_DISTANCE * a.w) {
                sum += (float4)(a.xyz, 1.0f);
                other += (float4)(b.xyz, 0.0f);
            }
        }
    const float3 first = sum.xyz / fmax(sum.w, 1.0f), second = other.xyz / fmax(sum.w, 1.0f);
    const float3 factor = (second + dark) / (first + dark);
    const float lit = luminance(first) + dark, relit = luminance(second) + dark;
    const float unknown = dark / fmin(lit, relit);
    const float error =
        fmax(DISTRUST * fabs(log(relit / lit)) * (1.0f - unknown) + changed * unknown, LEAST_ERROR);
    // As many samples as correspond to that error.
    const float most = 1.0f / (error * error);
    for (int i = 0; i < CACHE_SURFACES; i++) {
        const int entry = cell + i * cells;
        relight(mean, entry, entries, factor);
        relight(smooth, entry, entries, factor);
        const float samples = mean[entry].w, left = fmin(samples, most);
        if (plane[entry].w > 0.0f)
            plane[entry].w += samples - left;
        mean[entry].w = left;
    }
}
