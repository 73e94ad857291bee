// Cells of the panorama in an equirect grid: mean radiance, and the surface at the centre of the cell.
//
// in   panorama          lib/world/real/real.h
//      prefiltered       lib/trace/prefiltered.h; `level` has the grid's resolution
// out  cells             2 float4 a cell: radiance, distance in metres (0: open sky); normal, 1 at windows
#include "trace/prefiltered.h"
#include "world/real/real.h"

__kernel void light_cells(
    const int real_width,
    const int real_height,
    __global const float4 *restrict real_surface,
    const Prefiltered panorama,
    const int level,
    __global float4 *restrict cells)
{
    const int4 size = panorama.levels[level];
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= size.x || y >= size.y)
        return;
    const int column = (2 * x + 1) * real_width / (2 * size.x);
    const int row = (2 * y + 1) * real_height / (2 * size.y);
    const float4 surface = real_surface[row * real_width + column];
    const float3 d = texel_direction(column, row, real_width, real_height);
    const int sky = (int)surface.w & SURFACE_NONE;
    const float inverse = dot(surface.xyz, d);
    const int cell = y * size.x + x;
    cells[2 * cell] = (float4)(vload3(size.z + cell, panorama.texels),
                               !sky && inverse > 0.0f ? 1.0f / inverse : 0.0f);
    cells[2 * cell + 1] = (float4)(safe_normalize(-surface.xyz, -d),
                                   (int)surface.w & SURFACE_OPENING ? 1.0f : 0.0f);
}
