// Uneven pixels: their color blends texels of several planes without a sharp edge. They lie at creases, on
// rough depth and around objects of a few texels. Relit by their central texel alone, they would show its
// outline.
//
// is_uneven() is for lane loops (maths/lanes.h).
#pragma once

#include "world/real/real.h"
#include "world/real/reconstruct.h"

#define UNEVEN -2        // marks uneven pixels in other_pixel (compositing/real_layer.cl)
#define SAME_PLANE 0.05f // difference of planes, over the larger gradient, up to which they count as one
#define TWO_PLANES 0.2f  // the same from which they count as two

// Return the difference of two texels' planes, 0 to 1. The plane of open sky is at infinity.
static inline ALWAYS_INLINE float plane_difference(
    __global const float4 *restrict panorama_surface, int one, int other)
{
    __global const float *restrict a = (__global const float *)panorama_surface + 4 * one;
    __global const float *restrict b = (__global const float *)panorama_surface + 4 * other;
    const float x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    const float larger
        = fmax(a[0] * a[0] + a[1] * a[1] + a[2] * a[2], b[0] * b[0] + b[1] * b[1] + b[2] * b[2]);
    const float share = (x * x + y * y + z * z) / fmax(larger, FLT_MIN);
    return smoothstep(SAME_PLANE * SAME_PLANE, TWO_PLANES * TWO_PLANES, share);
}

// Return whether the texels around a point show several planes: plane_difference() > 0 for a pair of them.
static inline ALWAYS_INLINE int is_uneven(__global const float4 *restrict panorama_surface, Taps around)
{
    __global const float *restrict planes = (__global const float *)panorama_surface;
    const float x = planes[4 * around.a], y = planes[4 * around.a + 1], z = planes[4 * around.a + 2];
    const float squared = x * x + y * y + z * z;
    float beyond = 0.0f;
    #pragma unroll
    for (int k = 1; k < 4; k++) {
        const int texel = k == 1 ? around.b : k == 2 ? around.below_a : around.below_b;
        const float u = planes[4 * texel], v = planes[4 * texel + 1], w = planes[4 * texel + 2];
        const float larger = fmax(squared, u * u + v * v + w * w);
        const float apart = (u - x) * (u - x) + (v - y) * (v - y) + (w - z) * (w - z);
        beyond = fmax(beyond, apart - SAME_PLANE * SAME_PLANE * larger);
    }
    return beyond > 0.0f;
}

// Write each surrounding texel's share in the pixel's bilinear radiance, weighted by the difference of its
// plane from the nearest texel's, and the pixels that show these texels. A texel outside the view gets the
// pixel itself.
static inline ALWAYS_INLINE void store_corners(
    __global const float *restrict panorama_color, __global const float4 *restrict panorama_surface,
    int panorama_width, int panorama_height, Footprint inside, int x, int y, int width, int height,
    __global float *restrict shares, __global int *restrict pixels)
{
    const Taps around = equirect_taps(panorama_width, panorama_height, inside.middle);
    const int texels[4] = {around.a, around.b, around.below_a, around.below_b};
    const int upper = around.fx < 0.5f ? around.a : around.b;
    const int lower = around.fx < 0.5f ? around.below_a : around.below_b;
    const int nearest = around.fy < 0.5f ? upper : lower;
    const float2 right = inside.right * (float2)(panorama_width, panorama_height);
    const float2 down = inside.down * (float2)(panorama_width, panorama_height);
    const float inverse = 1.0f / (right.x * down.y - right.y * down.x);
    float share[4], radiance = FLT_MIN;
    #pragma unroll
    for (int k = 0; k < 4; k++) {
        const float columns = (k & 1) - around.fx, rows = (k >> 1) - around.fy;
        const float3 color = vload3(texels[k], panorama_color);
        const float part = (1.0f - fabs(columns)) * (1.0f - fabs(rows)) * (color.x + color.y + color.z);
        radiance += part;
        share[k] = part * plane_difference(panorama_surface, nearest, texels[k]);
        const float column = x + 0.5f + (columns * down.y - rows * down.x) * inverse;
        const float row = y + 0.5f + (rows * right.x - columns * right.y) * inverse;
        const int is_in = column >= 0.0f && row >= 0.0f && column < width && row < height;
        pixels[k] = is_in ? (int)row * width + (int)column : y * width + x;
    }
    #pragma unroll
    for (int k = 0; k < 4; k++)
        shares[k] = share[k] / radiance;
}
