// Kernels that work on the items of a list, whose length only the device knows: the launch has as many
// work items as the list may have entries.
#ifndef IPRT_LIST_H
#define IPRT_LIST_H

#include "maths/bits.h"

// The place in the list that a work item works on. Groups that follow one another take places far
// apart, by bit reversal (the van der Corput sequence): runtimes for CPUs hand hundreds of consecutive
// groups to a thread, and the first ones would hold the whole list.
static inline int list_place(void)
{
    const uint groups = get_num_groups(0), zeros = clz(groups);
    const int group = get_group_id(0);
    // As many groups as a power of two allows; the rest stay where they are.
    const int place = group >> (31 - zeros) ? group : reverse_bits(group) >> 1 >> zeros;
    return (int)get_global_id(0) + (place - group) * (int)get_local_size(0);
}

// The `item` of a work item; those beyond the end of the list return.
#define LIST_ITEM(count)                                                                           \
    const int item = list_place();                                                                 \
    if (item >= (count))                                                                           \
        return

#endif
