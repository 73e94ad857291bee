// Panorama radiance, three floats a texel, and its luminance.
//
//   kernel         in                                  out
//   load_texels    color, the previous frame's texels  texels; sums for the flux and its change
//   sum_luminance  texels, hidden_light (remember.cl)  mean luminance of cells (lib/world/real/lights.h)
//
// Where the device shares the host's memory, load_texels sums the decoded picture in place. Otherwise it is
// launched for some rows at a time, so that the device never holds the decoded picture besides the texels.
#include "maths/maths.h"

// Adjacent texels per work item of load_texels.
#define STRIP 32

__kernel void load_texels(
    const int width,
    const int rows,                          // in `color`
    const int first,                         // index of the first row, in the other pictures
    const int done,                          // rows that were loaded before
    __global const float *restrict color,    // 3 a texel
    __global const float4 *restrict map,     // 3 rows of `Frame.color_map`, or null; w is 0
    __global const float *before,            // of the previous frame, possibly `texels`; or null
    __global float *texels,                  // out, or null where `color` is used in place
    __global float4 *restrict sums)          // out, per strip: sums over texels and channels of
                                             // differences, of the larger values, and of all; 0
{
    const int strip = get_global_id(0), y = get_global_id(1);
    const int strips = (width + STRIP - 1) / STRIP;
    if (strip >= strips || y < done || y >= rows)
        return;
    const int end = min((strip + 1) * STRIP, width);
    float3 apart = (float3)(0.0f), larger = apart, all = apart;
    for (int x = strip * STRIP; x < end; x++) {
        const int texel = (first + y) * width + x;
        const int from = y * width + x;
        // Except for the last texel: four floats take one load.
        float3 now = from + 1 < rows * width ? vload4(0, color + 3 * from).xyz
                                             : vload3(from, color);
        if (map)
            now = fmax((float3)(dot(map[0].xyz, now), dot(map[1].xyz, now), dot(map[2].xyz, now)),
                       0.0f);
        const float3 old = before ? vload3(texel, before) : now;
        apart += fabs(now - old);
        larger += fmax(now, old);
        all += now;
        if (texels)
            vstore3(now, texel, texels);
    }
    sums[(first + y) * strips + strip] = (float4)(
        apart.x + apart.y + apart.z, larger.x + larger.y + larger.z, all.x + all.y + all.z, 0.0f);
}

__kernel void sum_luminance(
    const int width,
    const int height,
    const int columns,                             // of cells; at most one a texel
    const int rows,
    __global const float *restrict texels,         // 3 a texel
    __global const float *restrict hidden_light,   // or null
    __global float *restrict mean)                 // out: columns x rows
{
    const int column = get_global_id(0), row = get_global_id(1);
    if (column >= columns || row >= rows)
        return;
    // The texels that the cell's range of row and column indices maps to.
    const int x0 = (column * width + columns - 1) / columns;
    const int x1 = ((column + 1) * width + columns - 1) / columns;
    const int y0 = (row * height + rows - 1) / rows, y1 = ((row + 1) * height + rows - 1) / rows;
    float sum = 0.0f;
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++) {
            const float light = luminance(vload3(y * width + x, texels));
            sum += hidden_light ? fmax(light, hidden_light[y * width + x]) : light;
        }
    mean[row * columns + column] = sum / (float)((x1 - x0) * (y1 - y0));
}
