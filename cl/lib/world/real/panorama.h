// Radiance lookups in the panorama.
#ifndef IPRT_PANORAMA_H
#define IPRT_PANORAMA_H

#include "maths/tracing.h"

// The blend of four texels' channel `c`, of `stride` to a texel.
static inline float blend_texels(
    __global const float *restrict color, int stride, int c, int a, int b, int below_a, int below_b,
    float fx, float fy)
{
    const float top = mix(color[stride * a + c], color[stride * b + c], fx);
    const float bottom = mix(color[stride * below_a + c], color[stride * below_b + c], fx);
    return mix(top, bottom, fy);
}

// The first three channels at uv, bilinear, of `stride` to a texel: wraps around in azimuth, holds the
// first and last row at the poles. Channel by channel, so that PoCL vectorizes it.
static inline ALWAYS_INLINE float3 equirect_bilinear(
    __global const float *restrict color, int stride, int width, int height, float2 uv)
{
    const float x = uv.x * width - 0.5f, y = clamp(uv.y * height - 0.5f, 0.0f, height - 1.0f);
    const float left = floor(x), upper = floor(y);
    const float fx = x - left, fy = y - upper;
    int x0 = (int)left, x1 = x0 + 1;
    x0 = x0 < 0 ? x0 + width : x0;
    x1 = x1 >= width ? x1 - width : x1;
    const int row0 = (int)upper * width, row1 = min((int)upper + 1, height - 1) * width;
    const int a = row0 + x0, b = row0 + x1, below_a = row1 + x0, below_b = row1 + x1;
    return (float3)(blend_texels(color, stride, 0, a, b, below_a, below_b, fx, fy),
                    blend_texels(color, stride, 1, a, b, below_a, below_b, fx, fy),
                    blend_texels(color, stride, 2, a, b, below_a, below_b, fx, fy));
}

// The same of a picture of the panorama, which has three.
static inline ALWAYS_INLINE float3 panorama_bilinear(
    __global const float *restrict color, int width, int height, float2 uv)
{
    return equirect_bilinear(color, 3, width, height, uv);
}

#endif
