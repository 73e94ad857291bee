// Batched launches: up to three layers or signals at once, along the third dimension of the grid. A frame
// of few pixels is bound by the number of launches. Each entry has its own buffers. Missing entries of a
// smaller batch are bound to the first entry's (iprt/gbuffer/batch.py).
#ifndef IPRT_BATCH_H
#define IPRT_BATCH_H

// BATCHED declares a parameter per entry: NAME_0, NAME_1, ... OF_BATCH selects the work item's `entry`.
#define MOST_ENTRIES 3
#define BATCHED(TYPE, NAME) TYPE NAME##_0, TYPE NAME##_1, TYPE NAME##_2
#define OF_BATCH(NAME) (entry == 0 ? NAME##_0 : entry == 1 ? NAME##_1 : NAME##_2)

// The same for kernels whose batches always have one entry.
#define SINGLE(TYPE, NAME) TYPE NAME##_0
#define OF_SINGLE(NAME) NAME##_0

#define PLANES_IN __global const float *restrict
#define PLANES_OUT __global float *restrict

// Spans (gbuffer/guide.cl) of all layers in one buffer, and the layers of the batch. One buffer serves all
// entries, because CPU compilers do not vectorize further accesses unless they know that nothing aliases
// it.
#define SPAN_PARAMETERS __global const int *restrict spans, BATCHED(const int, layer)

// Return the first and end column of a work group's row; the first group starts at the span's start. Empty
// below the picture.
static inline int2 group_span(__global const int *restrict spans, int layer, int y, int height)
{
    const int2 span = vload2(layer * height + min(y, height - 1), spans);
    return (int2)(span.x + (int)(get_group_id(0) * get_local_size(0)), y < height ? span.y : 0);
}

// Define the pixel x, y and the entry of a work item inside the row's span; the others return. A group
// outside returns by a condition uniform over its items: with a condition per item, vectorized groups would
// run on.
#define SPAN_ITEM                                                                                  \
    const int y = get_global_id(1), entry = get_global_id(2);                                      \
    const int2 columns = group_span(spans, OF_BATCH(layer), y, height);                            \
    if (columns.x >= columns.y)                                                                    \
        return;                                                                                    \
    const int x = columns.x + get_local_id(0);                                                     \
    if (x >= columns.y)                                                                            \
        return

#endif
