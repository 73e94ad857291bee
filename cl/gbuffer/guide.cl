// Gathers the guide (guide.h), seven planes of features by which image-space passes compare pixels.
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top. World: +Y up, metres, origin at the
// capture centre.
//
//   kernel        in                                           out
//   find_spans    depth (1, m, 0 = no surface), id (1, 0 =     spans: columns where there are surfaces
//                 nothing to trace), past
//   build_guide   normal (3), depth, id, spans                 guide (7); id 0 without depth
//
// Work groups may have any size.
#include "gbuffer/batch.h"
#include "gbuffer/guide.h"
#include "gbuffer/row.h"
#include "gbuffer/view.h"

// Finds the columns of each row between which a layer has surfaces in this picture or had some in the two
// before. Passes that work on these columns alone have written 0 to all others, also with double buffers.
__kernel void find_spans(
    PLANES_IN depth[MOST_ENTRIES],               // radial distance in metres, 0 = no surface
    PLANES_IN id[MOST_ENTRIES],                  // 0 = nothing to trace, else the surface's id
    const int layer[MOST_ENTRIES],
    const int layers,                            // layers of the batch
    __global int *restrict past,                 // in, out: per layer and row first column and end in
                                                 // the last picture, and in the one before
    __global int *restrict spans,                // out: per layer and row first column and end
    int width,
    int height)
{
    SHARED_BY_ROW;
    const int y = row_of_item(height);
    const Columns own = columns_of_item();
    int first = width, end = 0;
    for (int x = own.first; x < (y < height ? width : 0); x += own.step) {
        int p = plane_index(x, y, width);
        bool surface = depth[p] > 0.0f && id[p] > 0.0f;
        first = surface ? min(first, x) : first;
        end = surface ? x + 1 : end;
    }
    const int2 now = SPAN_OF_ROW(first, end, width);
    if (lane_of_row() > 0 || y >= height || entry >= layers)
        return;
    const int row = layer * height + y;
    const int4 before = vload4(row, past);
    vstore4((int4)(now, before.xy), row, past);
    vstore2((int2)(min(now.x, min(before.x, before.z)), max(now.y, max(before.y, before.w))), row, spans);
}

__kernel void build_guide(
    __global const float *restrict view,            // projection and rotation, view.h
    PLANES_IN normal[MOST_ENTRIES],              // world-space unit normals, 3 planes
    PLANES_IN depth[MOST_ENTRIES],               // radial distance in metres, 0 = no surface
    PLANES_IN id[MOST_ENTRIES],                  // 0 = nothing to trace, else the surface's id
    __global const int *restrict spans,             // where there are surfaces; the rest is 0
    const int layer[MOST_ENTRIES],
    PLANES_OUT guide[MOST_ENTRIES],              // out: 7 planes
    int width,
    int height,
    int seam)
{
    SPAN_ITEM;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    const float3 direction = direction_unbranched(view, (float2)(x + 0.5f, y + 0.5f));
    // Without loops over all planes: PoCL vectorizes it.
    #pragma unroll
    for (int c = 0; c < 3; c++)
        store_wrapped(guide + (GUIDE_NORMAL + c) * size, p, x, width, seam, normal[c * size + p]);
    store_wrapped(guide + GUIDE_POSITION * size, p, x, width, seam, depth[p] * direction.x);
    store_wrapped(guide + (GUIDE_POSITION + 1) * size, p, x, width, seam, depth[p] * direction.y);
    store_wrapped(guide + (GUIDE_POSITION + 2) * size, p, x, width, seam, depth[p] * direction.z);
    store_wrapped(guide + GUIDE_ID * size, p, x, width, seam, depth[p] > 0.0f ? fmax(id[p], 0.0f) : 0.0f);
}
