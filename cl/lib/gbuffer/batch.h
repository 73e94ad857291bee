// Batched launches: up to three layers or signals at once, along the third dimension of the grid. A frame
// of few pixels is bound by the number of launches. Each entry has its own buffers. Kernels declare
// parameters NAME[MOST_ENTRIES], of which NAME is the work item's (iprt/device/block.py).
#pragma once

#define MOST_ENTRIES 3

#define PLANES_IN __global const float *restrict
#define PLANES_OUT __global float *restrict

// Kernels take the spans (gbuffer/guide.cl) of all layers in one buffer, `spans`, and the `layer` of each
// entry. CPU compilers do not vectorize accesses to further buffers unless they know that nothing aliases
// them.

// Return the first and end column of a work group's row; the first group starts at the span's start. Empty
// below the picture.
static inline int2 group_span(__global const int *restrict spans, int layer, int y, int height)
{
    const int2 span = vload2(layer * height + min(y, height - 1), spans);
    return (int2)(span.x + (int)(get_group_id(0) * get_local_size(0)), y < height ? span.y : 0);
}

// Define the pixel x, y of a work item inside the row's span; the others return. A group
// outside returns by a condition uniform over its items: with a condition per item, vectorized groups would
// run on.
#define SPAN_ITEM                                                                                  \
    const int y = get_global_id(1);                                                                \
    const int2 columns = group_span(spans, layer, y, height);                                      \
    if (columns.x >= columns.y)                                                                    \
        return;                                                                                    \
    const int x = columns.x + get_local_id(0);                                                     \
    if (x >= columns.y)                                                                            \
        return
