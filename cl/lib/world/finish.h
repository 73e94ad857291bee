// Parameters of a principled surface at a point, besides its albedo: metalness, and alpha of GGX; negative: the
// material's means.
//
// -D COAT_NORMALS adds the normal of the clearcoat, in the frame of the shading normal, by stereographic projection
// from the opposite pole: (0, 0) is the shading normal itself.
#pragma once

#include "maths/sampling.h"

#ifdef COAT_NORMALS
typedef float4 Finish;
#else
typedef float2 Finish;
#endif

// Least 1 + z of a normal that is projected.
#define COAT_POLE 1e-3f

static inline float2 packed_coat_normal(float3 n, float3 coat_normal)
{
    const float3 own = frame_to_local(build_frame(n), coat_normal);
    return own.xy / fmax(1.0f + own.z, COAT_POLE);
}

static inline float3 unpacked_coat_normal(float2 packed)
{
    const float squared = dot(packed, packed);
    return (float3)(2.0f * packed, 1.0f - squared) / (1.0f + squared);
}
