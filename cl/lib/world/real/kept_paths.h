// Paths of rays through the real layer, kept from frame to frame: x, y: uv in a picture; z: weight; w: which
// picture (lib/world/world.h), or NO_PICTURE.
#pragma once

#include "world/world.h"

// End of a path without light: a direction below the surface.
#define NO_PICTURE 3

// Return whether the shorter great circle from unit p to unit q meets one of the cones, xyz: axis; w: cosine
// of half the angle, not negative. A negative count: anything may have changed.
static inline int meets(__global const float4 *restrict cones, int count, float3 p, float3 q)
{
    const float3 across = cross(p, q);
    const float size = dot(across, across);
    int met = count < 0;
    for (int i = 0; i < count; i++) {
        const float4 cone = cones[i];
        const float aside = dot(across, cone.xyz);
        const int ends = dot(p, cone.xyz) >= cone.w || dot(q, cone.xyz) >= cone.w;
        const int between = dot(cross(across, p), cone.xyz) >= 0.0f
            && dot(cross(q, across), cone.xyz) >= 0.0f
            && aside * aside <= (1.0f - cone.w * cone.w) * size;
        met = met || ends || between;
    }
    return met;
}

// Return whether surfaces have changed on a path that begins at unit p.
static inline int outdated(__global const float4 *restrict cones, int count, float3 p, float4 path)
{
    return count < 0
        || meets(cones, count, p,
                 path.w == NO_PICTURE ? p : equirect_direction(path.x, path.y));
}

// Return the end of a ray: uv in a picture, weight, picture (lib/world/world.h).
static inline ALWAYS_INLINE float4 path_of(const RealLayer real, float3 p, float3 n, float3 d, float weight)
{
    float2 uv;
    const RealHit hit = trace_real_layer(real, real_start(real, p, n), d, INFINITY);
    const int picture = radiance_picture(real, hit, d, &uv);
    return (float4)(uv, weight, (float)picture);
}

static inline ALWAYS_INLINE float3 path_radiance(const RealLayer real, float4 path)
{
    return path.w == NO_PICTURE
        ? (float3)(0.0f)
        : path.z * picture_radiance(real, (int)path.w, path.xy);
}
