// What real surfaces radiate to all sides: the radiance that the camera sees, without the highlight.
//
//   in   colour (3 planes, radiance of the real layer), highlight (3 planes, >= 0, may be infinite)
//   out  diffuse (3 planes), >= 0; the bits of the input where there is no highlight
#include "planes.h"

__kernel void split_highlight(
    __global const float *restrict colour,
    __global const float *restrict highlight,
    __global float *restrict diffuse,
    int width,
    int height)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    for (int c = 0; c < 3; c++)
        diffuse[c * size + p] = fmax(colour[c * size + p] - highlight[c * size + p], 0.0f);
}
