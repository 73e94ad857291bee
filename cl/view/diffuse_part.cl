// What real surfaces radiate to all sides: the radiance that the camera sees, in the colours that
// rays find, without the highlight.
//
//   in   colour (3 planes, radiance of the real layer),
//        -DCOLOR_MAP: maps (lib/world/real/color_map.h),
//        -DGLOSS: highlight (3 planes, >= 0, may be infinite; in the colours that rays find)
//   out  diffuse (3 planes), >= 0; the bits of the input where there is neither map nor highlight
#include "gbuffer/planes.h"
#ifdef COLOR_MAP
#include "world/real/color_map.h"
#endif

__kernel void diffuse_part(
    __global const float *restrict colour,
#ifdef COLOR_MAP
    __global const float4 *restrict maps,
#endif
#ifdef GLOSS
    __global const float *restrict highlight,
#endif
    __global float *restrict diffuse,
    int width,
    int height)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    float3 left = load_planes(colour, size, p);
#ifdef COLOR_MAP
    left = map_color(maps, TO_REFERENCE, left);
#endif
#ifdef GLOSS
    left -= load_planes(highlight, size, p);
#endif
    store_planes(diffuse, size, p, fmax(left, 0.0f));
}
