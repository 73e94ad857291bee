// Signals that are accumulated and filtered, `planes` values per pixel. Of real surfaces, 6: E_R rgb and
// E_RV rgb (-DCOMMON), or blocked / E_R rgb and bounce / E_R rgb. Reflected ones, 3: rgb.
#ifndef IPRT_SIGNAL_H
#define IPRT_SIGNAL_H

#include "maths/maths.h"
#include "maths/tracing.h"

#define REAL_PLANES 6
#define REFLECTED_PLANES 3

// Loops over the planes are unrolled, so that arrays of them are registers.
#define EACH_PLANE(c, planes)                                                                      \
    _Pragma("unroll") for (int c = 0; c < REAL_PLANES; c++)                                        \
        if (c < REFLECTED_PLANES || (planes) == REAL_PLANES)

// The scalar that the picture shows, by which differences between pixels and frames are judged.
static inline ALWAYS_INLINE float guide_scalar(int planes, const float *s)
{
    return planes == REAL_PLANES ? luminance((float3)(s[0] - s[3], s[1] - s[4], s[2] - s[5]))
                                 : luminance((float3)(s[0], s[1], s[2]));
}

#endif
