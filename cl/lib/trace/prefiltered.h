// Mip chain of the panorama's radiance, which cones look up by their width (trace/reduce_panorama.cl).
// -D OPENING_ENVIRONMENT: a second chain of the radiance behind windows, in all directions.
#pragma once

#include "maths/equirect.h"
#include "trace/voxels.h"
#include "world/real/panorama.h"

static inline float3 prefiltered_level(const Prefiltered panorama, int level, float2 uv)
{
    const int4 at = panorama.levels[level];
    return panorama_bilinear(panorama.texels + 3 * at.z, at.x, at.y, uv);
}

// Return the mean radiance over about `width` radians around the direction d, interpolated between levels.
static inline float3 prefiltered_radiance(const Prefiltered panorama, float3 d, float width)
{
    const float2 uv = equirect_uv(d);
    const float texels = fmax(width * panorama.levels[0].y * (1.0f / IPRT_PI), 1.0f);
    const float level = fmin(log2(texels), (float)(panorama.count - 1));
    const int fine = (int)level, coarse = min(fine + 1, panorama.count - 1);
    return mix(prefiltered_level(panorama, fine, uv), prefiltered_level(panorama, coarse, uv),
               level - (float)fine);
}

// Return the radiance that arrives through a cone: of the room, from behind its windows, and around it.
static inline float3 all_arriving(const Surroundings around, const Cone cone, const ConeLight room)
{
    // Side of a square of the cone's solid angle.
    const float wide = sqrt(IPRT_PI) * cone.slope;
    float3 sum = room.radiance + room.passed * prefiltered_radiance(around.panorama, cone.d, wide);
#ifdef OPENING_ENVIRONMENT
    if (room.open > 0.0f)
        sum += room.open * prefiltered_radiance(around.outside, cone.d, wide);
#endif
    return sum;
}
