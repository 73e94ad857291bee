// Residual noise after the à-trous filter: at edges one or two pixels wide, pixels have no similar ones to
// average with. They are blended with the mean of their surroundings, regardless of normals, the more the
// noisier they are: the linear minimum mean squared error estimate of a value that differs from that mean
// by SPREAD (J.-S. Lee, "Digital Image Enhancement and Noise Filtering by Use of Local Statistics", IEEE
// TPAMI 1980).
#pragma once

#include "gbuffer/guide.h"
#include "gbuffer/stored.h"

#define SPREAD 0.1f            // standard deviation of change / E_R between neighbours
#define NEGLIGIBLE 1e-3f       // variance up to which pixels are unchanged
#define RESIDUAL_SIDE 5
#define RESIDUAL_PLANE 0.003f  // distance between planes of one surface, over the distance to the camera

typedef struct {
    __global const float *signal;    // 6 planes, filtered
    STORED_IN variance;              // 1 plane, variance of the mean of its guide scalar
    __global const float *guide;     // 7 planes
    int size;
    int stride;
} Filtered;

// Return a weight of pixel q for the surface of p: 1 if either lies in the other's plane, else less.
static inline float residual_weight(const Filtered f, int p, int q)
{
    const float3 x = load_planes(f.guide + GUIDE_POSITION * f.size, f.size, p);
    const float3 apart = load_planes(f.guide + GUIDE_POSITION * f.size, f.size, q) - x;
    const float off_p = fabs(dot(load_planes(f.guide, f.size, p), apart));
    const float off_q = fabs(dot(load_planes(f.guide, f.size, q), apart));
    const int same = f.guide[GUIDE_ID * f.size + q] == f.guide[GUIDE_ID * f.size + p];
    return same ? falloff(fmin(off_p, off_q) / (RESIDUAL_PLANE * length(x) + 1e-30f)) : 0.0f;
}

typedef struct {
    float3 blocked; // over E_R
    float3 bounce;
} Change;

// Return the denoised value of pixel p. Returned by value: written through pointers, Intel's CPU runtime
// loses the results of vectorized work items.
static inline Change settled_change(const Filtered f, int p)
{
    const float3 own_blocked = load_planes(f.signal, f.size, p);
    const float3 own_bounce = load_planes(f.signal + 3 * f.size, f.size, p);
    const float variance = load_stored_variance(f.variance, p);
    float3 blocked_around = (float3)(0.0f), bounce_around = (float3)(0.0f);
    float weights = 0.0f;
    const int taps = variance > NEGLIGIBLE ? RESIDUAL_SIDE * RESIDUAL_SIDE : 0;
    for (int i = 0; i < taps; i++) {
        const int dx = i % RESIDUAL_SIDE - RESIDUAL_SIDE / 2, dy = i / RESIDUAL_SIDE - RESIDUAL_SIDE / 2;
        const int q = p + dx + dy * f.stride;
        const float near = q == p ? 0.0f : residual_weight(f, p, q);
        const float w = near / (SPREAD * SPREAD + load_stored_variance(f.variance, q));
        blocked_around += w * load_planes(f.signal, f.size, q);
        bounce_around += w * load_planes(f.signal + 3 * f.size, f.size, q);
        weights += w;
    }
    const float share = weights > 0.0f ? (variance - NEGLIGIBLE) / (variance + SPREAD * SPREAD) : 0.0f;
    const float scale = weights > 0.0f ? 1.0f / weights : 0.0f;
    const Change result = {own_blocked + share * (scale * blocked_around - own_blocked),
                           own_bounce + share * (scale * bounce_around - own_bounce)};
    return result;
}
