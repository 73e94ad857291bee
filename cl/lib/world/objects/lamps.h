// Emitting triangles of the objects as lights that rays are aimed at. -D EMISSION with -D OBJECTS_BVH: there are some.
//
// A triangle is chosen in proportion to its area times its material's mean emission, and a point on it uniformly, so
// that the density per area is the emission over a constant. A ray is aimed at a point on either side; whether it is
// the nearest along the ray is left to the tracing.
#pragma once

#include "maths/maths.h"
#include "world/objects/objects.h"

#if defined(EMISSION) && defined(OBJECTS_BVH)
#define LAMPS

// In place of the texel of a light of the panorama that a ray is aimed at.
#define LAMP_TEXEL 0x7ffffffd
// Hits this much nearer or farther than the point aimed at, as a share of its distance, are not it.
#define LAMP_NEARNESS 1e-3f

static inline int lamps_shine(const Objects world) { return world.lamps.count > 0; }

// Find the triangle in which a share u of the power ends.
static inline int find_lamp(const Lamps lamps, float u)
{
    int low = -1, high = lamps.count - 1;   // share[low] <= u < share[high]
    while (high - low > 1) {
        const int middle = (low + high) >> 1;
        if (as_float(lamps.triangles[middle].z) <= u)
            low = middle;
        else
            high = middle;
    }
    return high;
}

// Return the unit direction from x to a random point of the lamps, and its distance; u in [0, 1)^2, `which` in
// [0, 1).
static inline float3 towards_lamp(const Objects world, float3 x, float2 u, float which, float *distance)
{
    const int2 place = world.lamps.triangles[find_lamp(world.lamps, which)].xy;
    __global const float4 *rows = world.bvh.instances + BVH_INSTANCE_ROWS * place.x + 3;
    __global const float4 *packet = world.bvh.packets + BVH_PACKET_ROWS * (place.y >> 2);
    const float inner = sqrt(u.x);
    float3 p = (1.0f - inner) * packet_corner(packet, 0, place.y & 3);
    p += inner * (1.0f - u.y) * packet_corner(packet, 1, place.y & 3);
    p += inner * u.y * packet_corner(packet, 2, place.y & 3);
    const float3 away = bvh_transform(rows, p, 1.0f) - x;
    *distance = length(away);
    return safe_normalize(away, (float3)(0.0f, 1.0f, 0.0f));
}

// Return the density per solid angle of that at a hit in the direction of a ray: `emission` is its material's mean,
// `facing` the cosine between the ray and the triangle's plane, t the distance.
static inline float lamp_density(const Objects world, float emission, float facing, float t)
{
    return emission * t * t / (world.lamps.power * fmax(facing, 1e-6f));
}

#endif
