// Work counters of kernels that trace rays. With -D COUNT_WORK, kernels that take `const Work work` count
// into a buffer (iprt/device/counting.py). Without it, all macros are empty.
//
//   counter        counts
//   WORK_ITEMS     active work items
//   WORK_REAL      rays through the panorama
//   WORK_OBJECTS   rays towards objects
//
// Each ray counter has four values: rays, steps of all marches (low and high 32 bits), and steps of the
// longest march.
#pragma once

#include <iprt.device.counting>

#ifdef COUNT_WORK

#define WORK_ITEMS 0
#define WORK_REAL 1
#define WORK_OBJECTS 5

#define COUNT_ITEM atomic_inc(work.counters + WORK_ITEMS)
#define COUNT_RAY(work, of) atomic_inc((work) + (of))
#define COUNT_STEPS(work, of, steps) count_steps((work) + (of), steps)

static inline void count_steps(__global uint *counter, uint steps)
{
    const uint before = atomic_add(counter + 1, steps);
    if (before + steps < before)
        atomic_inc(counter + 2);
    atomic_max(counter + 3, steps);
}

#else

#define COUNT_ITEM
#define COUNT_RAY(work, of)
#define COUNT_STEPS(work, of, steps)

#endif
