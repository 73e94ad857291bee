// Kernels that find the columns of a row between which something holds, launched over row_items() of
// iprt/gbuffer/layout.py. On GPUs a work group of any size takes a row. On CPUs (-D WIDE) a work item does: they
// would only wait for each other.
#pragma once

#include "maths/kernel_attributes.h"

// The columns of a work item.
typedef struct {
    int first, step;
} Columns;

#ifdef WIDE

#define SHARED_BY_ROW
#define SPAN_OF_ROW(FIRST, END, WIDTH) (int2)(FIRST, END)

static inline int lane_of_row(void) { return 0; }

static inline int row_of_item(int height)
{
    return get_global_id(1) == 0 ? (int)get_global_id(0) : height;
}

static inline Columns columns_of_item(void)
{
    return (Columns){0, 1};
}

#else

#define SHARED_BY_ROW __local int both[2]
#define SPAN_OF_ROW(FIRST, END, WIDTH) span_of_row(both, FIRST, END, WIDTH)

static inline int lane_of_row(void)
{
    return get_local_id(1) * get_local_size(0) + get_local_id(0);
}

// Return the row; `height` or more: none. Not by the index of the group, which counts within a part of a launch
// (iprt/device/bands.py).
static inline int row_of_item(int height)
{
    return get_global_id(1) < get_local_size(1) ? (int)(get_global_id(0) / get_local_size(0)) : height;
}

// Return columns that differ between the work items of a row. Neighbours load neighbouring values.
static inline Columns columns_of_item(void)
{
    return (Columns){lane_of_row(), get_local_size(0) * get_local_size(1)};
}

// Return first column and end of a row, (width, 0) if there are none, from those of its work items. All of them
// call it.
static inline ALWAYS_INLINE int2 span_of_row(__local int *both, int first, int end, int width)
{
    if (lane_of_row() == 0) {
        both[0] = width;
        both[1] = 0;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (first < end) {
        atomic_min(both, first);
        atomic_max(both + 1, end);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    return (int2)(both[0], both[1]);
}

#endif
