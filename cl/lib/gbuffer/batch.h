// Launches that work on a batch of up to three layers or signals at once, the third dimension of the
// grid: a frame of few pixels costs what its launches cost. Each entry has buffers of its own; those
// that a smaller batch lacks are bound to its first entry's (iprt/gbuffer/batch.py).
#ifndef IPRT_BATCH_H
#define IPRT_BATCH_H

// BATCHED declares a parameter for each entry: NAME_0, NAME_1, ...; OF_BATCH is that of the work
// item's `entry`.
#define MOST_ENTRIES 3
#define BATCHED(TYPE, NAME) TYPE NAME##_0, TYPE NAME##_1, TYPE NAME##_2
#define OF_BATCH(NAME) (entry == 0 ? NAME##_0 : entry == 1 ? NAME##_1 : NAME##_2)

// The same of kernels whose batches always have one entry.
#define SINGLE(TYPE, NAME) TYPE NAME##_0
#define OF_SINGLE(NAME) NAME##_0

#define PLANES_IN __global const float *restrict
#define PLANES_OUT __global float *restrict

// Spans (gbuffer/guide.cl) of all layers in one buffer, and which layers' are those of the batch. One
// buffer for all entries: compilers for CPUs do not vectorize what follows if they cannot tell that
// nobody writes it.
#define SPAN_PARAMETERS __global const int *restrict spans, BATCHED(const int, layer)

// First column and end of what a work group has to do in its row, where the first group begins with
// the span; nothing below the picture.
static inline int2 group_span(__global const int *restrict spans, int layer, int y, int height)
{
    const int2 span = vload2(layer * height + min(y, height - 1), spans);
    return (int2)(span.x + (int)(get_group_id(0) * get_local_size(0)), y < height ? span.y : 0);
}

// The pixel x, y and the entry of a work item whose row has something to do; the others end. A group
// without any ends by what is the same for all of its items: where each item decides for itself,
// vectorized groups go on.
#define SPAN_ITEM                                                                                  \
    const int y = get_global_id(1), entry = get_global_id(2);                                      \
    const int2 columns = group_span(spans, OF_BATCH(layer), y, height);                            \
    if (columns.x >= columns.y)                                                                    \
        return;                                                                                    \
    const int x = columns.x + get_local_id(0);                                                     \
    if (x >= columns.y)                                                                            \
        return

#endif
