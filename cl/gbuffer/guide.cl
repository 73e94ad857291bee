// Gathers the guide (guide.h), seven planes of features by which image-space passes compare pixels.
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top. World: +Y up, metres, origin at the
// capture centre.
//
//   in    normal (3 planes), depth (1, m, 0 = no surface), id (1, 0 = nothing to trace), tiles
//   out   guide (7); id 0 without depth
#include "gbuffer/tiles.h"
#include "gbuffer/view.h"

__kernel void build_guide(
    __global const float *restrict view,            // projection and rotation, view.h
    PLANES_IN normal[MOST_ENTRIES],              // world-space unit normals, 3 planes
    PLANES_IN depth[MOST_ENTRIES],               // radial distance in metres, 0 = no surface
    PLANES_IN id[MOST_ENTRIES],                  // 0 = nothing to trace, else the surface's id
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    __global const int *restrict states,
    PLANES_OUT guide[MOST_ENTRIES],              // out: 7 planes
    int width,
    int height,
    int seam)
{
    TILE_ITEM;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    const int awake = is_awake(states[layer * tiles_of(width, height) + tile]);
    const float3 direction = direction_unbranched(view, (float2)(x + 0.5f, y + 0.5f));
    // Without loops over all planes: PoCL vectorizes it.
    #pragma unroll
    for (int c = 0; c < 3; c++)
        store_wrapped(guide + (GUIDE_NORMAL + c) * size, p, x, width, seam, normal[c * size + p]);
    store_wrapped(guide + GUIDE_POSITION * size, p, x, width, seam, depth[p] * direction.x);
    store_wrapped(guide + (GUIDE_POSITION + 1) * size, p, x, width, seam, depth[p] * direction.y);
    store_wrapped(guide + (GUIDE_POSITION + 2) * size, p, x, width, seam, depth[p] * direction.z);
    const float shown = depth[p] > 0.0f ? fmax(id[p], 0.0f) : 0.0f;
    store_wrapped(guide + GUIDE_ID * size, p, x, width, seam, awake || !(shown > 0.0f) ? shown : SLEEPING);
}
