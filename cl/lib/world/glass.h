// Dielectrics that light passes through, -D GLASS with triangles as objects: REFRACTS.
//
// A ray knows the media it is in. Where solids overlap, the medium of the highest priority fills the space (C.
// Schmidt and B. Budge, "Simple Nested Dielectrics in Ray Traced Images", Journal of Graphics Tools 7(2), 2002).
// Thin walls have no inside: rays go straight on.
#pragma once

#include "world/dielectric.h"
#include "world/direction.h"
#include "world/world.h"

#ifdef REFRACTS

// Most surfaces of dielectrics on a path that do not count as bounces.
#define MOST_INTERFACES 16
// Least probabilities of reflection and of refraction, at the first surface of a path and at later ones. A bright light
// reflected within glass would be a speck at the probability of the reflection, which is 0.04 in most directions.
#define LEAST_FIRST 0.25f
#define LEAST_LATER 0.1f

static inline float4 absorption_and_priority(__global const float4 *restrict materials, int material)
{
    return materials[material * MATERIAL_ROWS + MEDIUM_ROW];
}

// Return the material of the medium that fills the space, -1: air. Of equal priorities, the last entered counts.
static inline int filling(__global const float4 *restrict materials, ulong media)
{
    int chosen = -1;
    float most = -INFINITY;
    for (int i = 0; i < MOST_MEDIA; i++) {
        const int material = medium_at(media, i);
        const float priority = material < 0 ? -INFINITY : absorption_and_priority(materials, material).w;
        chosen = priority > most ? material : chosen;
        most = fmax(most, priority);
    }
    return chosen;
}

static inline float medium_ior(__global const float4 *restrict materials, int material)
{
    return material < 0 ? 1.0f : materials[material * MATERIAL_ROWS].z;
}

// Return the transmittance of `t` metres of a medium (Beer and Lambert); t may be infinite.
static inline float3 medium_transmittance(__global const float4 *restrict materials, int material, float t)
{
    return material < 0 ? (float3)(1.0f) : exp(-fmin(t, FLT_MAX) * absorption_and_priority(materials, material).xyz);
}

// Return the share of light that a surface lets pass straight on, without refraction: of a ray along d that has come
// `t` metres, inside of the solid where it leaves.
static inline float3 straight_share(
    __global const float4 *restrict materials, const Material material, const Scatterer at, float3 d, float t)
{
    const float reflected = fresnel_dielectric(fabs(dot(at.normal, d)), material.ior);
    if (material.thin)
        return at.albedo * (1.0f - reflected) / (1.0f + reflected);
    const float3 crossed = at.enters ? (float3)(1.0f) : medium_transmittance(materials, at.material, t);
    return crossed * at.albedo * (1.0f - reflected);
}

// Return how a dielectric sends on a ray in `media`: the weight is `specular`. The new ray starts at o_object towards
// objects, at o towards real surfaces. `t`: metres from the real surface where the ray began, which may be inside of the
// solid; negative: it began elsewhere.
static inline ALWAYS_INLINE Scatter scatter_glass(
    const World world, const Material material, const Scatterer at, float3 wo, float t, float3 u, float least,
    ulong media, float3 *o, float3 *o_object)
{
#ifdef VARIANTS
    // A ray may leave through another variant than it entered by.
    const int medium = without_variant(world.materials, at.material);
#else
    const int medium = at.material;
#endif
    const ulong beyond = material.thin ? media
        : at.enters                    ? entered(media, medium)
                                       : left_behind(media, medium);
    const int before = filling(world.materials, media), after = filling(world.materials, beyond);
    float3 weight = (float3)(1.0f), wi = -wo;
    int passes = 1;
    if (material.thin || before != after) {
        const float eta
            = material.thin ? material.ior : medium_ior(world.materials, after) / medium_ior(world.materials, before);
        const Frame frame = build_frame(at.normal);
        const float3 i = sample_dielectric(material, eta, at.albedo, brdf_local_wo(frame, wo), u, least, &weight);
        wi = frame_to_world(frame, i);
        passes = i.z < 0.0f;
        // Interpolated normals must not send the ray to the other side of the triangle.
        const float rise = dot(wi, at.plane);
        if (passes ? rise > -MIN_RISE : rise < MIN_RISE)
            wi = normalize(wi + ((passes ? -MIN_RISE : MIN_RISE) - rise) * at.plane);
    } else if (t >= 0.0f) {
        // The solid stands on the real surface, where the ray has entered it.
        const float3 share = straight_share(world.materials, material, at, -wo, t);
        weight = share * share / fmax(medium_transmittance(world.materials, at.material, t), 1e-6f);
    }
    Scatter s = no_scatter(wi);
    s.specular = weight;
    s.media = passes ? beyond : media;
    *o_object = passes ? at.beyond : at.position;
    // A real surface that the solid stands on is met by rays that leave through its bottom.
    *o = passes ? at.beyond + world.real.bias * at.plane : at.position;
    return s;
}

// Return the factor of the radiance of a real surface that a ray meets inside of a solid, after t metres: the solid
// stands in it.
static inline float3 left_through_surface(__global const float4 *restrict materials, ulong media, float t)
{
    const int medium = filling(materials, media);
    const float ior = medium_ior(materials, medium);
    return ior * ior * medium_transmittance(materials, medium, t);
}

#endif
