// Equirect mapping of the scene format: row 0 is the zenith (+Y), the image centre looks along -Z, and +X
// is to its right. uv in [0, 1): column / width, row / height.
#pragma once

#include "maths/kernel_attributes.h"
#include "maths/maths.h"

#define IPRT_PI 3.14159265358979f

// Return the unit direction of uv, both in [0, 1]. The elevation has Taylor series of its own: two calls of
// unit_circle() would be merged into vectors, and PoCL would not vectorize the kernel.
static inline ALWAYS_INLINE float3 equirect_direction(float u, float v)
{
    const float x = (0.5f - v) * IPRT_PI, x2 = x * x;
    const float up = x * (1.0f + x2 * (-1.0f / 6.0f + x2 * (1.0f / 120.0f + x2 * (-1.0f / 5040.0f + x2 *
                          (1.0f / 362880.0f + x2 * (-1.0f / 39916800.0f + x2 * (1.0f / 6227020800.0f)))))));
    const float past = fmin(v, 1.0f - v) * IPRT_PI, past2 = past * past; // the nearer pole
    const float level = past * (1.0f + past2 * (-1.0f / 6.0f + past2 * (1.0f / 120.0f + past2 *
                                (-1.0f / 5040.0f + past2 * (1.0f / 362880.0f + past2 *
                                (-1.0f / 39916800.0f))))));
    const float2 azimuth = unit_circle(u); // from +Z
    return (float3)(-level * azimuth.y, up, level * azimuth.x);
}

// Return the unit direction of a texel's centre.
static inline float3 texel_direction(int column, int row, int width, int height)
{
    return equirect_direction((column + 0.5f) / width, (row + 0.5f) / height);
}

// Return the uv of a direction of any length.
static inline ALWAYS_INLINE float2 equirect_uv(float3 d)
{
    float u = fast_atan2(d.x, -d.z) * (0.5f / IPRT_PI) + 0.5f;
    float v = fast_atan2(sqrt(d.x * d.x + d.z * d.z), d.y) * (1.0f / IPRT_PI);
    // As u - floor(u), which PoCL computes by branches.
    return (float2)(u - (u >= 1.0f ? 1.0f : 0.0f) + (u < 0.0f ? 1.0f : 0.0f), v);
}

// Return the row-major index of the texel at uv. `size` is (width, height): along rays it is an argument of the
// kernel of its own, because compilers for GPUs would keep its conversion in registers.
static inline int sized_texel(float2 uv, int width, int height, float2 size)
{
    return min((int)(uv.y * size.y), height - 1) * width + min((int)(uv.x * size.x), width - 1);
}

static inline int equirect_texel(float2 uv, int width, int height)
{
    return sized_texel(uv, width, height, (float2)((float)width, (float)height));
}
