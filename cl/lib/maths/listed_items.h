// Kernels over the items of a list whose length only the device knows. The launch has one work item per
// possible entry.
#pragma once

#include "maths/bits.h"

// Return the list index of a work item. Consecutive groups take indices far apart, by bit reversal (the van
// der Corput sequence). Runtimes for CPUs give a thread hundreds of consecutive groups, and the first
// thread would get the whole list.
static inline int list_place(void)
{
    const uint groups = get_num_groups(0), zeros = clz(groups);
    const int group = get_group_id(0);
    // Only the largest power of two of groups is permuted; the others keep their place.
    const int place = group >> (31 - zeros) ? group : reverse_bits(group) >> 1 >> zeros;
    return (int)get_global_id(0) + (place - group) * (int)get_local_size(0);
}

// Define `item` for a work item; work items beyond the end of the list return.
#define LIST_ITEM(count)                                                                           \
    const int item = list_place();                                                                 \
    if (item >= (count))                                                                           \
        return
