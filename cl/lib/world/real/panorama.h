// Radiance lookups in the panorama, and its displayed colors where lights were clipped.
#pragma once

#include <iprt.world.real.displayed_colors>

#include "maths/kernel_attributes.h"

#define OUTSIDE_ROWS 128 // rows of the distant environment behind windows, of twice as many columns

// Four texels around a direction, and their bilinear coordinates.
typedef struct {
    int a, b, below_a, below_b;
    float fx, fy;
    int column, next_column, row, next_row; // of a and below_b; rows by their first texels
} Taps;

// Return the taps at uv. Wraps around in azimuth, clamps to the first and last row at the poles. `size` as in
// sized_texel().
static inline ALWAYS_INLINE Taps sized_taps(int width, int height, float2 size, float2 uv)
{
    const float x = uv.x * size.x - 0.5f, y = clamp(uv.y * size.y - 0.5f, 0.0f, size.y - 1.0f);
    // Truncated, as PoCL computes floor() by branches.
    int x0 = (int)x - (x < 0.0f ? 1 : 0), x1 = x0 + 1;
    const int upper = (int)y;
    const float fx = x - x0, fy = y - upper;
    x0 = x0 < 0 ? x0 + width : x0;
    x1 = x1 >= width ? x1 - width : x1;
    const int row0 = upper * width, row1 = min(upper + 1, height - 1) * width;
    return (Taps){row0 + x0, row0 + x1, row1 + x0, row1 + x1, fx, fy, x0, x1, row0, row1};
}

static inline ALWAYS_INLINE Taps equirect_taps(int width, int height, float2 uv)
{
    return sized_taps(width, height, (float2)((float)width, (float)height), uv);
}

static inline ALWAYS_INLINE float blend_taps(
    Taps t, float a, float b, float below_a, float below_b)
{
    return mix(mix(a, b, t.fx), mix(below_a, below_b, t.fx), t.fy);
}

// Return the blend of channel `c` of four texels of `stride` channels.
static inline ALWAYS_INLINE float blend_texels(
    __global const float *restrict color, int stride, int c, Taps t)
{
    return blend_taps(t, color[stride * t.a + c], color[stride * t.b + c],
                      color[stride * t.below_a + c], color[stride * t.below_b + c]);
}

// Return the first three channels at uv, bilinear, of texels of `stride` channels. Channel by channel, so
// that PoCL vectorizes it.
static inline ALWAYS_INLINE float3 equirect_bilinear(
    __global const float *restrict color, int stride, int width, int height, float2 size, float2 uv)
{
    const Taps t = sized_taps(width, height, size, uv);
    return (float3)(blend_texels(color, stride, 0, t), blend_texels(color, stride, 1, t),
                    blend_texels(color, stride, 2, t));
}

// Return the same for a picture of the panorama, of three channels.
static inline ALWAYS_INLINE float3 panorama_bilinear(
    __global const float *restrict color, int width, int height, float2 uv)
{
    return equirect_bilinear(color, 3, width, height, (float2)((float)width, (float)height), uv);
}

// Return whether a part of the color is not shown.
static inline ALWAYS_INLINE int shows_part(Shown shown)
{
    return shown.rest != shown.color;
}

// Return channel `c` of a texel as displayed.
static inline ALWAYS_INLINE float shown_texel(Shown shown, int texel, int c)
{
    const float sent = shown.color[3 * texel + c] - (shows_part(shown) ? shown.rest[3 * texel + c] : 0.0f);
    if (!shown.clipped)
        return sent;
    const uint word = shown.clipped[2 * (texel >> 5)], before = shown.clipped[2 * (texel >> 5) + 1];
    const uint bit = 1u << (texel & 31);
    const int row = before + popcount(word & (bit - 1u));
    const float seen = shown.clipped_color[3 * row + c];
    return word & bit ? seen : sent;
}

// Return a texel's color as displayed.
static inline ALWAYS_INLINE float3 shown_color(Shown shown, int texel)
{
    return shown.clipped ? (float3)(shown_texel(shown, texel, 0), shown_texel(shown, texel, 1),
                                    shown_texel(shown, texel, 2))
         : shows_part(shown) ? vload3(texel, shown.color) - vload3(texel, shown.rest)
                             : vload3(texel, shown.color);
}
