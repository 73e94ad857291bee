// Distance impostor: a cube map of radiance and inverse distance around a point, in which rays from other
// points find real surfaces (L. Szirmay-Kalos, B. Aszódi, I. Lazányi, M. Premecz, "Approximate Ray-Tracing
// on the GPU with Distance Impostors", Computer Graphics Forum 24(3), 2005).
//
// Inverse distances are blended between texels: on a plane they are linear across a face, up to the length
// of the direction. In open sky they are 0. Faces are not blended with each other.
#pragma once

#include "maths/cube.h"
#include "world/real/panorama.h"
#include <iprt.world.real.panorama>

// Points this many times as far from the centre as the surface in their direction are hidden from it.
#define IMPOSTOR_HIDDEN 1.25f

// Return the four texels of a face around a direction of any length.
static inline ALWAYS_INLINE Taps cube_taps(int side, float3 v)
{
    const float3 size = fabs(v);
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const float3 r = to_face(axis, v);
    const float scale = 0.5f * side / fmax(fabs(r.x), 1e-30f), middle = 0.5f * side - 0.5f;
    const float x = clamp(scale * r.y + middle, 0.0f, side - 1.0f);
    const float y = clamp(scale * r.z + middle, 0.0f, side - 1.0f);
    const int x0 = (int)x, y0 = (int)y, x1 = min(x0 + 1, side - 1);
    const int face = (2 * axis + (r.x < 0.0f)) * side;
    const int row0 = (face + y0) * side, row1 = (face + min(y0 + 1, side - 1)) * side;
    return (Taps){row0 + x0, row0 + x1, row1 + x0, row1 + x1, x - x0, y - y0};
}

// Return the inverse distance, 1/m, towards v, relative to the impostor's centre.
static inline ALWAYS_INLINE float impostor_inverse_distance(const Impostor impostor, float3 v)
{
    return blend_texels(impostor.inverse, 1, 0, cube_taps(impostor.side, v));
}

static inline ALWAYS_INLINE float3 impostor_radiance(const Impostor impostor, float3 v)
{
    __global const float *texels = (__global const float *)impostor.texels;
    const Taps t = cube_taps(impostor.side, v);
    return (float3)(blend_texels(texels, 4, 0, t), blend_texels(texels, 4, 1, t),
                    blend_texels(texels, 4, 2, t));
}

// Return whether a surface hides the point x, relative to the centre, from the centre.
static inline ALWAYS_INLINE int impostor_hides(const Impostor impostor, float3 x)
{
    return length(x) * impostor_inverse_distance(impostor, x) > IMPOSTOR_HIDDEN;
}

// Return the metres along the ray from x, relative to the impostor's centre, to its hit; at most
// `farthest`.
//
// The first guess is the plane perpendicular to the ray through the surface in the ray's direction. Each
// step looks up the distance of the surface in the direction of the last point. Once points before and
// behind the surface are known, the next one is their secant's; until then, the point moves by its error.
static inline ALWAYS_INLINE float trace_impostor(const Impostor impostor, float3 x, float3 d)
{
    const float least = 1.0f / impostor.farthest;
    const float first = 1.0f / fmax(impostor_inverse_distance(impostor, d), least);
    float t = clamp(first - dot(x, d), 0.0f, impostor.farthest);
    float under = 0.0f, over = 0.0f, under_ratio = 0.0f, over_ratio = 0.0f;
    int is_under = 0, is_over = 0;
    for (int step = 0; step < impostor.steps; step++) {
        const float3 at = x + t * d;
        const float inverse = fmax(impostor_inverse_distance(impostor, at), least);
        const float ratio = length(at) * inverse;
        if (ratio < 1.0f) {
            is_under = 1;
            under = t;
            under_ratio = ratio;
        } else {
            is_over = 1;
            over = t;
            over_ratio = ratio;
        }
        const float next = is_under && is_over
            ? under + (over - under) * (1.0f - under_ratio) / (over_ratio - under_ratio)
            : t + (1.0f - ratio) / inverse;
        t = clamp(next, 0.0f, impostor.farthest);
    }
    return t;
}
