// Planes of values that last for one frame. -D HALF_PLANES: in half precision, where memory traffic costs
// more than conversion. Otherwise they are planes of float (planes.h).
//
// Half precision has 11 bits from 6e-5 to 65504, and steps of 6e-8 below. Values beyond are clamped;
// non-finite values stay non-finite. A variance is stored as its square root: its square has half the
// range. Kernels that write radiance into such planes multiply it by a unit of the scene (`half_unit` of
// iprt/filter/signals.py).
#pragma once

#include "gbuffer/planes.h"

#ifdef HALF_PLANES
#define STORED half
#else
#define STORED float
#endif

#define STORED_IN __global const STORED *restrict
#define STORED_OUT __global STORED *restrict

#define LARGEST_HALF 65504.0f
#define NOT_STORED 1e30f      // values from here on, and NaN, mark unused entries

static inline float load_stored(STORED_IN plane, int p)
{
#ifdef HALF_PLANES
    return vload_half(p, plane);
#else
    return plane[p];
#endif
}

static inline float load_stored_variance(STORED_IN plane, int p)
{
    const float value = load_stored(plane, p);
#ifdef HALF_PLANES
    return value * value;
#else
    return value;
#endif
}

static inline void store_stored(STORED_OUT plane, int p, float value)
{
#ifdef HALF_PLANES
    const float clamped = fmin(fmax(value, -LARGEST_HALF), LARGEST_HALF);
    vstore_half(fabs(value) < NOT_STORED ? clamped : value, p, plane);
#else
    plane[p] = value;
#endif
}

static inline void store_stored_variance(STORED_OUT plane, int p, float value)
{
#ifdef HALF_PLANES
    value = sqrt(value);
#endif
    store_stored(plane, p, value);
}

#ifdef HALF_PLANES
#define PUT(at) vstore_half(value, at, plane)
#else
#define PUT(at) plane[at] = value
#endif

// As wrap_row() of planes.h.
static inline void wrap_stored(STORED_OUT plane, int first, int end, int y, int width, int seam)
{
    for (int x = first; seam && x < end; x++) {
        const int p = plane_index(x, y, width);
        const float value = load_stored(plane, p);
        AT_BORDER(PUT)
    }
}

#undef PUT
