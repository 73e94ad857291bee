// Reconstruction of the panorama between its texels and over a pixel's footprint.
#pragma once

#include "gbuffer/view.h"
#include "world/real/panorama.h"

#define MAX_POINTS 8  // lookups across a pixel
#define SPACING 1.5f  // texels between lookups: each covers two
#define OVERSHOOT 0.05f // of cubic convolution, relative: textures need some, lights would get rings

// Return the lookups across a pixel that leave out no texel under it; 1 if the view is about as fine as the
// panorama, or finer.
static inline ALWAYS_INLINE int points_across(__global const float *restrict view, int height)
{
    // At the centre of a perspective view, where pixels are largest.
    const float rows = is_equirect(view) ? view[13] : IPRT_PI * view[9];
    const float texels = height / rows;
    return (int)clamp(ceil(texels / SPACING - 1e-3f), 1.0f, (float)MAX_POINTS);
}

// A pixel's uv in the panorama, to first order.
typedef struct {
    float2 middle, right, down; // at the centre; change per pixel to the right, and down
} Footprint;

// Return the change of direction d's uv when d changes by `by`; at a pole, by half a turn at most.
static inline ALWAYS_INLINE float2 uv_change(float3 d, float3 by)
{
    const float flat = fmax(d.x * d.x + d.z * d.z, 1e-12f), level = sqrt(flat);
    const float turn = (d.x * by.z - d.z * by.x) / flat;
    const float out = (d.x * by.x + d.z * by.z) / level;
    return (float2)(clamp(turn * (0.5f / IPRT_PI), -0.5f, 0.5f),
                    (d.y * out - level * by.y) / ((flat + d.y * d.y) * IPRT_PI));
}

// Return the footprint of a pixel, whose centre is at `uv`, in direction `ahead` of the view and d of the world.
static inline ALWAYS_INLINE Footprint footprint(
    __global const float *restrict view, float2 uv, float3 ahead, float3 d)
{
    const int equirect = is_equirect(view);
    const float width = -ahead.z / view[9];
    const float level = sqrt(fmax(ahead.x * ahead.x + ahead.z * ahead.z, 1e-12f));
    const float column = 2.0f * IPRT_PI / view[12], row = IPRT_PI / view[13];
    const float along = row * ahead.y / level;
    const float3 right = (float3)(projected(equirect, -column * ahead.z, width), 0.0f,
                                  projected(equirect, column * ahead.x, 0.0f));
    const float3 down = (float3)(projected(equirect, along * ahead.x, 0.0f),
                                 projected(equirect, -row * level, -width),
                                 projected(equirect, along * ahead.z, 0.0f));
    return (Footprint){uv, uv_change(d, view_rotate_to_world(view, right)),
                       uv_change(d, view_rotate_to_world(view, down))};
}

static inline ALWAYS_INLINE float3 blend_shown(Shown shown, Taps t)
{
    return mix(mix(shown_color(shown, t.a), shown_color(shown, t.b), t.fx),
               mix(shown_color(shown, t.below_a), shown_color(shown, t.below_b), t.fx), t.fy);
}

// Weights of cubic convolution with a = -1/2 (Keys 1981, Eq. 15) for four texels in a row. The point is
// between the second and third, 0 <= t <= 1.
typedef struct {
    float a, b, c, d;
} Cubic;

static inline ALWAYS_INLINE Cubic cubic_weights(float t)
{
    return (Cubic){((1.0f - 0.5f * t) * t - 0.5f) * t, (1.5f * t - 2.5f) * t * t + 1.0f,
                   ((2.0f - 1.5f * t) * t + 0.5f) * t, (0.5f * t - 0.5f) * t * t};
}

typedef struct {
    int left, a, b, right;          // columns
    int above, upper, lower, below; // first texels of rows
    Cubic x, y;
} CubicTaps;

// Return the taps at uv. Wraps around in azimuth, clamps to the first and last row at the poles.
static inline ALWAYS_INLINE CubicTaps cubic_taps(int width, int height, float2 uv)
{
    const Taps t = equirect_taps(width, height, uv);
    CubicTaps found;
    found.upper = t.row;
    found.lower = t.next_row;
    found.above = max(found.upper - width, 0);
    found.below = min(found.lower + width, (height - 1) * width);
    found.a = t.column;
    found.b = t.next_column;
    found.left = found.a > 0 ? found.a - 1 : width - 1;
    found.right = found.b < width - 1 ? found.b + 1 : 0;
    found.x = cubic_weights(t.fx);
    found.y = cubic_weights(t.fy);
    return found;
}

static inline ALWAYS_INLINE float3 cubic_row(Cubic weights, float3 left, float3 a, float3 b, float3 right)
{
    return weights.a * left + weights.b * a + weights.c * b + weights.d * right;
}

static inline ALWAYS_INLINE float3 shown_row(Shown shown, int row, CubicTaps t)
{
    return cubic_row(t.x, shown_color(shown, row + t.left), shown_color(shown, row + t.a),
                     shown_color(shown, row + t.b), shown_color(shown, row + t.right));
}

// Return the color by cubic convolution, clamped almost to the range of the four texels around the point, so
// that lights have no rings.
static inline ALWAYS_INLINE float3 cubic_shown(Shown shown, CubicTaps t)
{
    const float3 v00 = shown_color(shown, t.upper + t.a), v10 = shown_color(shown, t.upper + t.b);
    const float3 v01 = shown_color(shown, t.lower + t.a), v11 = shown_color(shown, t.lower + t.b);
    const float3 sum = cubic_row(t.y, shown_row(shown, t.above, t), shown_row(shown, t.upper, t),
                                 shown_row(shown, t.lower, t), shown_row(shown, t.below, t));
    const float3 low = fmin(fmin(v00, v10), fmin(v01, v11)), high = fmax(fmax(v00, v10), fmax(v01, v11));
    return clamp(sum, (1.0f - OVERSHOOT) * low, (1.0f + OVERSHOOT) * high);
}

// Return a picture's color at uv by cubic convolution.
static inline ALWAYS_INLINE float3 shown_at(Shown shown, int width, int height, float2 uv)
{
    return cubic_shown(shown, cubic_taps(width, height, uv));
}

// Return a picture's mean color in a pixel, of `points` x `points` bilinear lookups all over it.
static inline ALWAYS_INLINE float3 shown_in_pixel(
    Shown shown, int width, int height, Footprint inside, int points)
{
    const float apart = 1.0f / points;
    float3 sum = (float3)(0.0f);
    for (int i = 0; i < points * points; i++) {
        const float right = (i % points + 0.5f) * apart - 0.5f, down = (i / points + 0.5f) * apart - 0.5f;
        const float u = inside.middle.x + right * inside.right.x + down * inside.down.x;
        const float v = inside.middle.y + right * inside.right.y + down * inside.down.y;
        sum += blend_shown(shown, equirect_taps(width, height, (float2)(u - floor(u), v)));
    }
    return apart * apart * sum;
}
