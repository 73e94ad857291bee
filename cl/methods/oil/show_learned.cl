// Learned radiance of the real surfaces in a view.
//
// in   guide   7 planes (lib/gbuffer/guide.h): world normal, position, id
//      models  lib/world/real/learned.h
// out  shown   3 planes: radiance, 0 where nothing was learned
#include "gbuffer/planes.h"
#include "world/real/learned.h"

__kernel void show_learned(
    const int width,
    const int height,
    __global const float *restrict guide,
    const Learned learned,
    __global float *restrict shown)             // out
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int pixel = plane_index(x, y, width), size = plane_size(width, height);
    float4 radiance = (float4)(0.0f);
    if (guide[6 * size + pixel] > 0.0f)
        radiance = learned_radiance(learned, load_planes(guide + 3 * size, size, pixel),
                                    load_planes(guide, size, pixel));
    store_planes(shown, size, pixel, radiance.xyz);
}
