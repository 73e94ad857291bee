// Small arithmetic for hot kernels: no libm calls and no branches, so that PoCL vectorizes it.
#ifndef IPRT_MATHS_H
#define IPRT_MATHS_H

// 2^x. Relative error at most 1.1e-4, exact at integers; x is clamped to [-126, 127].
// x + 127 is positive, so truncation is floor and its integer part is the biased exponent; the
// cubic is the minimax of 2^f on [0, 1) that is exact at both ends, so the result is continuous.
inline float fast_exp2(float x)
{
    // A NaN fails both comparisons' "inside" side: it becomes 2^-126, not NaN.
    x = x > -126.0f ? x : -126.0f;
    x = x < 127.0f ? x : 127.0f;
    const float biased = x + 127.0f;
    const int exponent = (int)biased;
    const float f = biased - (float)exponent;
    const float mantissa = 1.0f + f * (0.69542435f + f * (0.22630768f + f * 0.07826797f));
    return as_float(exponent << 23) * mantissa;
}

// Luminance of linear Rec.709.
inline float luminance(float3 rgb)
{
    return 0.2126f * rgb.x + 0.7152f * rgb.y + 0.0722f * rgb.z;
}

// Neither infinite nor NaN, also where the compiler may assume that all numbers are finite.
inline int is_finite(float x)
{
    return (as_uint(x) & 0x7f800000u) != 0x7f800000u;
}

inline int is_finite3(float3 v)
{
    return is_finite(v.x) && is_finite(v.y) && is_finite(v.z);
}

// v / |v|, or `fallback` where v is too short or not finite.
inline float3 safe_normalize(float3 v, float3 fallback)
{
    // Scaled by the largest component, because the square of a short or long vector is 0 or inf.
    const float size = fmax(fabs(v.x), fmax(fabs(v.y), fabs(v.z)));
    if (!is_finite3(v) || !(size > 1e-30f))
        return fallback;
    v /= size;
    return v / sqrt(dot(v, v));
}

#endif
