// Launches that work on a batch of -DBATCH=n layers or signals at once, the third dimension of the
// grid: a frame of few pixels costs what its launches cost. Each entry has buffers of its own.
#ifndef IPRT_BATCH_H
#define IPRT_BATCH_H

// BATCHED declares a parameter for each entry: NAME_0, NAME_1, ...; OF_BATCH is that of the work
// item's `entry`.
#if BATCH == 1
#define BATCHED(TYPE, NAME) TYPE NAME##_0
#define OF_BATCH(NAME) NAME##_0
#elif BATCH == 2
#define BATCHED(TYPE, NAME) TYPE NAME##_0, TYPE NAME##_1
#define OF_BATCH(NAME) (entry == 0 ? NAME##_0 : NAME##_1)
#elif BATCH == 3
#define BATCHED(TYPE, NAME) TYPE NAME##_0, TYPE NAME##_1, TYPE NAME##_2
#define OF_BATCH(NAME) (entry == 0 ? NAME##_0 : entry == 1 ? NAME##_1 : NAME##_2)
#else
#error "a batch has one to three entries"
#endif

// Entries of rectangles of their own (x0, y0, x1, y1) are launched over one row of work groups: so
// many as cover all of them.
typedef struct {
    int entry, x, y; // the work item's pixel; beyond the rectangle at its edges
} BatchItem;

static inline int2 groups_over(int4 rect)
{
    const int2 group = (int2)(get_local_size(0), get_local_size(1));
    return (rect.zw - rect.xy + group - 1) / group;
}

static inline BatchItem batch_item(BATCHED(const int4, rect))
{
    // Not get_group_id, which knows no offset of a launch in parts.
    int entry = 0, number = (get_global_id(0) - get_local_id(0)) / get_local_size(0);
    // Without branches, which would keep compilers for CPUs from vectorizing what follows.
#if BATCH > 1
    const int2 first = groups_over(rect_0);
    const int second_from = first.x * first.y;
    entry = number >= second_from;
#if BATCH > 2
    const int2 second = groups_over(rect_1);
    const int third_from = second_from + second.x * second.y;
    entry += number >= third_from;
    number -= entry == 2 ? third_from - second_from : 0;
#endif
    number -= entry > 0 ? second_from : 0;
#endif
    const int4 rect = OF_BATCH(rect);
    const int columns = max(groups_over(rect).x, 1);
    const BatchItem item = {
        entry,
        rect.x + number % columns * (int)get_local_size(0) + (int)get_local_id(0),
        rect.y + number / columns * (int)get_local_size(1) + (int)get_local_id(1),
    };
    return item;
}

#if BATCH == 1
#define BATCH_ITEM batch_item(rect_0)
#elif BATCH == 2
#define BATCH_ITEM batch_item(rect_0, rect_1)
#else
#define BATCH_ITEM batch_item(rect_0, rect_1, rect_2)
#endif

#define PLANES_IN __global const float *restrict
#define PLANES_OUT __global float *restrict

#endif
