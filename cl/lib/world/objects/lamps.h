// Emitting triangles of the objects as lights that rays are aimed at. -D EMISSION with -D OBJECTS_BVH: there are some.
//
// A triangle is chosen in proportion to its area times its material's mean emission, and a point on it uniformly, so
// that the density per area is the emission over a constant. A ray is aimed at a point on either side; whether it is
// the nearest along the ray is left to the tracing. -D LAMP_TREE: there are many, and nearer ones are preferred. The
// choice descends a tree (iprt/world/objects/lamp_tree.py), to the child with the greater power over squared distance
// more often.
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

#ifdef LAMP_TREE
static inline float node_importance(const Lamps lamps, int node, float3 x)
{
    const float4 box = lamps.nodes[2 * node];
    const float3 away = box.xyz - x;
    return box.w / fmax(fmax(dot(away, away), lamps.nodes[2 * node + 1].x), FLT_MIN);
}

// Return the probability of the first child of a node, for a point x.
static inline float first_child(const Lamps lamps, int node, float3 x)
{
    const float first = node_importance(lamps, 2 * node, x), second = node_importance(lamps, 2 * node + 1, x);
    return first + second > 0.0f ? first / (first + second) : 1.0f;
}

// Choose a triangle for a point x; u in [0, 1).
static inline int choose_lamp(const Lamps lamps, float3 x, float u)
{
    int node = 1;
    for (int i = 0; i < lamps.levels; i++) {
        const float first = first_child(lamps, node, x);
        const int second = u >= first;
        u = fmin(second ? (u - first) / (1.0f - first) : u / first, 0x1.fffffep-1f);
        node = 2 * node + second;
    }
    return as_int(lamps.nodes[2 * node + 1].y);
}

// Return the index of a triangle, given by its instance and its place in the packets.
static inline int lamp_at(const Lamps lamps, int2 place)
{
    int low = 0, high = lamps.count;
    for (int i = 0; i < lamps.levels + 1; i++) {
        const int middle = (low + high) >> 1;
        const int2 found = lamps.triangles[middle].xy;
        const int later = found.x > place.x || (found.x == place.x && found.y > place.y);
        low = later ? low : middle;
        high = later ? middle : high;
    }
    return low;
}

// Return the probability of a triangle for a point x, over its share of the power.
static inline float lamp_preference(const Lamps lamps, float3 x, int2 place)
{
    int node = lamps.triangles[lamp_at(lamps, place)].w + (1 << lamps.levels);
    float chance = lamps.power / fmax(lamps.nodes[2 * node].w, FLT_MIN);
    for (int i = 0; i < lamps.levels; i++) {
        const float first = first_child(lamps, node >> 1, x);
        chance *= node & 1 ? 1.0f - first : first;
        node >>= 1;
    }
    return chance;
}
#else
static inline int choose_lamp(const Lamps lamps, float3 x, float u) { return find_lamp(lamps, u); }
static inline float lamp_preference(const Lamps lamps, float3 x, int2 place) { return 1.0f; }
#endif

// Return the unit direction from x to a random point of the lamps, and its distance; u in [0, 1)^2, `which` in
// [0, 1).
static inline float3 towards_lamp(const Objects world, float3 x, float2 u, float which, float *distance)
{
    const int2 place = world.lamps.triangles[choose_lamp(world.lamps, x, which)].xy;
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

// Return the density per solid angle of that at a hit of a ray from x: `emission` is its material's mean, `facing` the
// cosine between the ray and the triangle's plane.
static inline float lamp_density(const Objects world, ObjectHit hit, float3 x, float emission, float facing)
{
    const float preference = lamp_preference(world.lamps, x, (int2)(hit.instance, hit.triangle));
    return preference * emission * hit.t * hit.t / (world.lamps.power * fmax(facing, 1e-6f));
}

#endif
