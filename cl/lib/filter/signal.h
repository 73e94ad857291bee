// Signals to accumulate and filter, `planes` values per pixel. For real surfaces 6: E_R rgb and E_RV rgb
// (-DCOMMON), or blocked / E_R rgb and bounce / E_R rgb. For reflected signals 3: rgb.
#pragma once

#include "maths/maths.h"
#include "maths/kernel_attributes.h"

#define REAL_PLANES 6
#define REFLECTED_PLANES 3

// Planes of a mean's certainty: the variance of the mean of g, and its effective number of samples.
#define VARIANCE_PLANE 0
#define LENGTH_PLANE 1

// In the memory of a history, two planes follow the signal's: the variance of single samples of g, and g for
// comparisons between neighbours. This keeps kernels at no more than 31 buffers, the limit of some drivers.
#define SPREAD_PLANE 0
#define SCALAR_PLANE 1

#define SHORT_HISTORY 4.0f // fewer samples of one pixel do not determine their variance

// Return whether neighbours estimate the variance. The mean of four lengths of 4 may be rounded down.
static inline bool is_short(float samples) { return samples < SHORT_HISTORY - 0.5f; }

// Loops over the planes are unrolled, so that arrays of them stay in registers.
#define EACH_PLANE(c, planes)                                                                      \
    _Pragma("unroll") for (int c = 0; c < REAL_PLANES; c++)                                        \
        if (c < REFLECTED_PLANES || (planes) == REAL_PLANES)

// Return g, the displayed scalar by which pixels and frames are compared.
static inline ALWAYS_INLINE float guide_scalar(int planes, const float *s)
{
    return planes == REAL_PLANES ? luminance((float3)(s[0] - s[3], s[1] - s[4], s[2] - s[5]))
                                 : luminance((float3)(s[0], s[1], s[2]));
}
