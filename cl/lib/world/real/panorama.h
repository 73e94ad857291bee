// Radiance lookups in the panorama.
#ifndef IPRT_PANORAMA_H
#define IPRT_PANORAMA_H

#include "maths/tracing.h"

// The blend of four texels' channel `c`, of four to a texel.
static inline float blend_texels(
    __global const float *restrict color, int c, int a, int b, int below_a, int below_b, float fx,
    float fy)
{
    const float top = mix(color[4 * a + c], color[4 * b + c], fx);
    const float bottom = mix(color[4 * below_a + c], color[4 * below_b + c], fx);
    return mix(top, bottom, fy);
}

// Bilinear radiance at uv: wraps around in azimuth, holds the first and last row at the poles. Channel
// by channel, so that PoCL vectorizes it.
static inline ALWAYS_INLINE float3 panorama_bilinear(
    __global const float4 *restrict color, int width, int height, float2 uv)
{
    const float x = uv.x * width - 0.5f, y = clamp(uv.y * height - 0.5f, 0.0f, height - 1.0f);
    const float left = floor(x), upper = floor(y);
    const float fx = x - left, fy = y - upper;
    int x0 = (int)left, x1 = x0 + 1;
    x0 = x0 < 0 ? x0 + width : x0;
    x1 = x1 >= width ? x1 - width : x1;
    const int row0 = (int)upper * width, row1 = min((int)upper + 1, height - 1) * width;
    __global const float *restrict channels = (__global const float *)color;
    const int a = row0 + x0, b = row0 + x1, below_a = row1 + x0, below_b = row1 + x1;
    return (float3)(blend_texels(channels, 0, a, b, below_a, below_b, fx, fy),
                    blend_texels(channels, 1, a, b, below_a, below_b, fx, fy),
                    blend_texels(channels, 2, a, b, below_a, below_b, fx, fy));
}

#endif
