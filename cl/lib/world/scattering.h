// Directions in which opaque virtual surfaces scatter a path: sampled by the BRDF, or aimed at lights of the panorama, at
// the sun (-D SUN), at emitting objects (-D EMISSION) or at lights without geometry (-D VIRTUAL_LIGHTS).
#pragma once

#include "world/brdf.h"
#include "world/direction.h"
#include "world/world.h"

// Sampling of narrower lobes finds lights better than light sampling does.
#define AIMED_ALPHA 0.02f
// Share of the rays that are not aimed at other lights.
#define SUN_SHARE 0.4f
#define LAMP_SHARE 0.4f

static inline float light_share(const World world, const Material material)
{
    if (!lights_shine(world.lights))
        return 0.0f;
    if (material.kind == KIND_DIFFUSE)
        return 0.5f;
    return !is_specular(material) ? 0.35f : widest_alpha(material) > AIMED_ALPHA ? 0.25f : 0.0f;
}

#ifdef SUN
// Return whether x is in the box of an object that the sun may reach.
static inline int sun_may_reach(const Objects objects, float3 x)
{
    int reached = 0;
    for (int i = 0; i < objects.count; i++)
        reached |= objects.sunlit[i] && all(x >= objects.bounds[2 * i].xyz) && all(x <= objects.bounds[2 * i + 1].xyz);
    return reached;
}
#endif

// Sample a direction in which a virtual surface at x scatters; u in [0, 1)^4.
static inline ALWAYS_INLINE Scatter scatter(
    const World world, const Material material, float3 albedo, float3 x, float3 n, float3 wo, float4 u)
{
    Scatter s = no_scatter(n);
    s.light_share = light_share(world, material);
    float rest = 1.0f - s.light_share, below_lamps = 1.0f;
#ifdef SAMPLES_VIRTUAL_LIGHTS
    const int shines = world.objects.virtual_lights.count > 0 && (!is_specular(material) || widest_alpha(material) > 0.0f);
    const float virtual_share = shines ? LAMP_SHARE * rest : 0.0f;
    rest -= virtual_share;
    below_lamps -= virtual_share;
    if (u.w >= below_lamps) {
        float weight;
        s = at_virtual_light(world.objects.virtual_lights, x, n, u.xyz, &weight);
        const BrdfValue value = brdf_eval(material, albedo, n, wo, s.wi);
        weight *= brdf_cosine(n, s.wi) / virtual_share;
        s.diffuse = weight * value.diffuse;
        s.specular = weight * value.specular;
        return s;
    }
#endif
#ifdef LAMPS
    // Narrow lobes find lamps themselves.
    if (lamps_shine(world.objects) && (!is_specular(material) || widest_alpha(material) > AIMED_ALPHA)) {
        s.lamp_share = LAMP_SHARE * rest;
        rest -= s.lamp_share;
    }
    below_lamps -= s.lamp_share;
    if (u.w >= below_lamps) {
        s.texel = LAMP_TEXEL;
        s.wi = towards_lamp(world.objects, x, u.xy, u.z, &s.lamp_distance);
    }
#endif
#ifdef SUN
    // Mirrors and lobes hardly wider than the sun find it themselves.
    const int aims_at_sun = !is_specular(material) || widest_alpha(material) > AIMED_ALPHA;
    if (aims_at_sun && sun_may_reach(world.objects, x)) {
        s.sun_share = SUN_SHARE * rest;
        rest -= s.sun_share;
    }
    if (!is_at_lamp(s) && u.w >= below_lamps - s.sun_share) {
        s.texel = SUN_TEXEL;
        s.wi = sample_sun(world.real.sun, u.xy);
    } else
#endif
    if (u.w < s.light_share) {
        const float3 light = sample_light(world.lights, u.xy);
        s.texel = texel_towards(world.real, light);
        s.wi = towards_light(world.real, light, s.texel, x);
    } else if (!is_at_lamp(s)) {
        const BrdfSample sample = brdf_sample(material, albedo, n, wo, u.xyz);
        s.wi = sample.wi;
        if (is_mirrored(material, sample)) {
            s.specular = sample.weight / rest;
            return s;
        }
    }
#ifdef SUN
    // A ray that meets the sun by chance would be a bright speck.
    if (aims_at_sun && !(s.sun_share > 0.0f) && sun_density(world.real.sun, s.wi) > 0.0f)
        return s;
#endif
    const BrdfValue value = brdf_eval(material, albedo, n, wo, s.wi);
    const float2 density = brdf_pdf(material, albedo, n, wo, s.wi);
    const float cosine = brdf_cosine(n, s.wi);
    s.diffuse = value.diffuse * cosine;
    s.specular = value.specular * cosine;
    // Directions below the surface scatter no light, whatever their density.
    s.density = fmax(rest * (density.x + density.y), 1e-20f);
    return s;
}
