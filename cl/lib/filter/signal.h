// Signals that are accumulated and filtered: SIGNAL_PLANES values per pixel: of real surfaces
// (-DDIFFERENCE) E_R rgb and E_RV rgb, or blocked / E_R rgb and bounce / E_R rgb; of virtual ones
// reflected rgb.
#ifndef IPRT_SIGNAL_H
#define IPRT_SIGNAL_H

#include "maths/maths.h"

// The scalar that the picture shows, by which differences between pixels and frames are judged.
static inline float guide_scalar(const float *s)
{
#ifdef DIFFERENCE
    return luminance((float3)(s[0] - s[3], s[1] - s[4], s[2] - s[5]));
#else
    return luminance((float3)(s[0], s[1], s[2]));
#endif
}

#endif
