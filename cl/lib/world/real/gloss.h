// The gain of computed highlights (iprt/world/real/highlight_gain.py): cells of -D CELL x CELL texels.
#ifndef IPRT_GLOSS_H
#define IPRT_GLOSS_H

#include "world/real/panorama.h"

// `at` in texels of the panorama, (0, 0) its upper left corner.
static inline float3 gain_at(__global const float4 *restrict gain, int columns, int rows, float2 at)
{
    return equirect_bilinear((__global const float *)gain, 4, columns, rows,
                             at / ((float)CELL * (float2)((float)columns, (float)rows)));
}

#endif
