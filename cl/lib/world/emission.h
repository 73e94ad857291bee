// Light that virtual surfaces emit, -D EMISSION.
#pragma once

#include "world/brdf.h"
#include "world/direction.h"
#include "world/world.h"

#ifdef EMISSION

// Return the mean radiance that a material emits, and the mean of its channels.
static inline float4 mean_emission(const World world, int material)
{
    return world.materials[(material + 1) * MATERIAL_ROWS - 1];
}

// Return the radiance that a virtual surface emits.
static inline float3 emitted(const World world, const Scatterer at)
{
    return at.emission.x < 0.0f ? mean_emission(world, at.material).xyz : at.emission;
}

// Return the weight of a surface's emission that a ray from x has met, by the balance heuristic. `inverse` is 1 /
// density of the ways to sample its direction other than aiming at lamps. `alone`: those do not find the surface.
static inline float emission_weight(
    const World world, const Scatter s, const Scatterer at, const ObjectHit hit, float3 x, float inverse, int alone)
{
#ifdef LAMPS
    if (is_at_lamp(s) && fabs(hit.t - s.lamp_distance) > LAMP_NEARNESS * s.lamp_distance)
        return 0.0f;
    if (s.lamp_share > 0.0f) {
        const float mean = mean_emission(world, at.material).w;
        const float relative = inverse * s.lamp_share * lamp_density(world.objects, hit, x, mean, at.facing);
        return 1.0f / (alone ? fmax(relative, 1e-20f) : 1.0f + relative);
    }
#endif
    return 1.0f;
}

#endif
