// Pictures of the panorama, three floats a texel; and how bright they are.
//
//   kernel         in                                out
//   load_texels    color, those of the frame before  texels; sums, from which the flux and its
//                                                    change follow
//   sum_luminance  texels, hidden_light (remember.cl)  mean luminance of cells (lib/world/real/lights.h)
//
// Where the device reads the host's memory, load_texels sums up what was decoded as it is. Else it is
// launched for some rows at a time, so that what was decoded is never on the device besides texels.
#include "maths/maths.h"

// Texels side by side that a work item of load_texels takes.
#define STRIP 32

__kernel void load_texels(
    const int width,
    const int rows,                          // that `color` holds
    const int first,                         // number of the first one, in the other pictures
    const int done,                          // so many of them were loaded before
    __global const float *restrict color,    // 3 a texel
    __global const float4 *restrict map,     // 3 rows of `Frame.color_map`, or null; w is 0
    __global const float *before,            // of the frame before, perhaps `texels`; or null
    __global float *texels,                  // out, or null where `color` is read as it is
    __global float4 *restrict sums)          // out, per strip: over texels and channels, of what
                                             // they differ by, of the larger, and of all; 0
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
        // Where there is a next texel, with its first channel: four floats take one load.
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
    // The texels whose number times the cells, over all texels, is the cell's.
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
