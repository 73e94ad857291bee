// Arithmetic for hot kernels without libm calls or branches, so that PoCL vectorizes it.
#pragma once

#include "maths/kernel_attributes.h"

// Comparisons rather than fmin and fmax, which take several instructions to handle NaN.
static inline ALWAYS_INLINE float smaller(float a, float b) { return a < b ? a : b; }
static inline ALWAYS_INLINE float larger(float a, float b) { return a > b ? a : b; }

// Return 2^x. The relative error is at most 1.1e-4, and 0 at integers. x is clamped to [-126, 127]. As x +
// 127 is positive, truncation is floor, and its integer part is the biased exponent. The cubic is the
// minimax of 2^f on [0, 1) among those exact at both ends, so the result is continuous.
static inline float fast_exp2(float x)
{
    // A NaN fails both comparisons and becomes 2^-126.
    x = x > -126.0f ? x : -126.0f;
    x = x < 127.0f ? x : 127.0f;
    const float biased = x + 127.0f;
    const int exponent = (int)biased;
    const float f = biased - (float)exponent;
    const float mantissa = 1.0f + f * (0.69542435f + f * (0.22630768f + f * 0.07826797f));
    return as_float(exponent << 23) * mantissa;
}

// Return (1 - x/8)^8, an approximation of exp(-x) with compact support: exactly 0 for x >= 8 and for NaN.
// It takes five operations that vectorize everywhere and gives the same bits on every device.
static inline float falloff(float x)
{
    float w = x < 8.0f ? 1.0f - 0.125f * x : 0.0f;
    w *= w;
    w *= w;
    return w * w;
}

// Return atan2(y, x) to 3e-7, and 0 where both are 0: the minimax polynomial of atan(sqrt(s)) / sqrt(s) on
// [0, 1], with an error of 1.4e-8, mirrored by octant. Two adjacent calls of fabs would be merged into a
// vector of two, which keeps PoCL from vectorizing the kernel.
static inline ALWAYS_INLINE float fast_atan2(float y, float x)
{
    const float ax = larger(x, -x), ay = fabs(y);
    const float t = smaller(ax, ay) / larger(larger(ax, ay), 1e-37f), s = t * t;
    float p = 0.0029035560f;
    p = p * s - 0.016283022f;
    p = p * s + 0.043039389f;
    p = p * s - 0.075336777f;
    p = p * s + 0.10654678f;
    p = p * s - 0.14207134f;
    p = p * s + 0.19993055f;
    p = p * s - 0.33333093f;
    p = p * s * t + t;
    p = ay > ax ? 1.57079633f - p : p;
    p = x < 0.0f ? 3.14159265f - p : p;
    return copysign(p, y);
}

// Return (cos, sin) of 2 pi u for u in [0, 1], to 3e-7 absolute: the Taylor series within an eighth of a
// turn of the nearest quarter, then swapped and negated by quadrant.
static inline ALWAYS_INLINE float2 unit_circle(float u)
{
    const int quadrant = (int)(4.0f * u + 0.5f);
    const float x = (u - 0.25f * (float)quadrant) * 6.28318531f;
    const float x2 = x * x;
    const float s = x * (1.0f + x2 * (-1.0f / 6.0f + x2 * (1.0f / 120.0f + x2 *
                                      (-1.0f / 5040.0f + x2 * (1.0f / 362880.0f)))));
    const float c = 1.0f + x2 * (-0.5f + x2 * (1.0f / 24.0f + x2 *
                                 (-1.0f / 720.0f + x2 * (1.0f / 40320.0f))));
    const int odd = quadrant & 1;
    const float cosine = odd ? -s : c;
    const float sine = odd ? c : s;
    const float sign = quadrant & 2 ? -1.0f : 1.0f;
    return (float2)(sign * cosine, sign * sine);
}

// Return the luminance of linear Rec.709.
static inline float luminance(float3 rgb)
{
    return 0.2126f * rgb.x + 0.7152f * rgb.y + 0.0722f * rgb.z;
}

// Return whether x is neither infinite nor NaN, even if the compiler may assume finite numbers.
static inline int is_finite(float x)
{
    return (as_uint(x) & 0x7f800000u) != 0x7f800000u;
}

static inline int is_finite3(float3 v)
{
    return is_finite(v.x) && is_finite(v.y) && is_finite(v.z);
}

// Return v / |v|, or `fallback` where v is too short or not finite.
static inline float3 safe_normalize(float3 v, float3 fallback)
{
    // Scaled by the largest component: the square of a very short or long vector is 0 or infinite.
    const float size = fmax(fabs(v.x), fmax(fabs(v.y), fabs(v.z)));
    if (!is_finite3(v) || !(size > 1e-30f))
        return fallback;
    v /= size;
    return v / sqrt(dot(v, v));
}
