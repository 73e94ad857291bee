// Scattering of light by the surface of a dielectric, -D GLASS, and the media that a ray is in.
//
// Rough surfaces: B. Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007. The masking of
// reflection and refraction alike is separable, as in Mitsuba's `roughdielectric`.
#pragma once

#include "world/brdf.h"

#ifdef GLASS

// Media that a ray can be in at once: 1 + index of their materials in MEDIUM_BITS each, the last entered lowest.
#define MOST_MEDIA 4
#define MEDIUM_BITS 16

static inline int medium_at(ulong media, int place) { return (int)(media >> (MEDIUM_BITS * place) & 0xffff) - 1; }

static inline int is_inside_of(ulong media, int material)
{
    int inside = 0;
    for (int i = 0; i < MOST_MEDIA; i++)
        inside |= medium_at(media, i) == material;
    return inside;
}

// Return the media after a ray has entered a material.
static inline ulong entered(ulong media, int material)
{
    return is_inside_of(media, material) ? media : media << MEDIUM_BITS | (ulong)(material + 1);
}

// Return the media after a ray has left a material.
static inline ulong left_behind(ulong media, int material)
{
    for (int i = 0; i < MOST_MEDIA; i++)
        if (medium_at(media, i) == material) {
            const ulong later = ((ulong)1 << (MEDIUM_BITS * i)) - 1;
            return (media & later) | (media >> MEDIUM_BITS & ~later);
        }
    return media;
}

// Return the share of light that meets a material as a dielectric.
static inline float dielectric_share(const Material material)
{
    float share = material.kind == KIND_DIELECTRIC ? 1.0f : 0.0f;
#ifdef PRINCIPLED
    share = material.kind == KIND_PRINCIPLED ? (1.0f - material.metallic) * material.transmission : share;
#endif
    return share;
}

// Make a material that transmits a share of the light the opaque rest of it. Returns the factor of its diffuse lobe for
// callers that multiply it by the diffuse albedo of the whole.
static inline float become_opaque(Material *material)
{
    float factor = 1.0f;
#ifdef PRINCIPLED
    const float share = dielectric_share(*material), whole = 1.0f - material->metallic;
    material->metallic = share < 1.0f ? material->metallic / (1.0f - share) : 1.0f;
    factor = (1.0f - material->metallic) / fmax(whole, 1e-6f);
#endif
    return factor;
}

// Decide by u.y whether a ray meets a point of a surface as a dielectric; u in [0, 1)^2 is then as random as before.
static inline int is_passable(const Material material, float2 *u)
{
    const float share = dielectric_share(material);
    const int passes = u->y < share;
    u->y = passes ? u->y / share : (u->y - share) / (1.0f - share);
    return passes;
}

// Sample the reflection (z > 0) or refraction of o at a surface, both in the frame of its normal; u in [0, 1)^3, `eta`:
// index of refraction beyond relative to the near side. `least`: least probability of either. `weight` becomes f cos /
// density, of radiance: refraction scales it by 1 / eta^2.
static inline float3 sample_dielectric(const Material material, float eta, float3 color, float3 o, float3 u, float least,
                                       float3 *weight)
{
    float3 h = (float3)(0.0f, 0.0f, 1.0f);
    if (material.alpha > 0.0f)
        h = ggx_sample_normal(o, material.alpha, u.xy);
    const float cos_o = dot(o, h);
    float reflected = fresnel_dielectric(cos_o, eta);
    reflected = material.thin ? 2.0f * reflected / (1.0f + reflected) : reflected;
    const float probability = reflected < 1.0f ? clamp(reflected, least, 1.0f - least) : 1.0f;
    float3 i = 2.0f * cos_o * h - o;
    *weight = (float3)(reflected / probability);
    if (u.z >= probability) {
        const float cos_t = sqrt(fmax(1.0f - (1.0f - cos_o * cos_o) / (eta * eta), 0.0f));
        *weight = color * (1.0f - reflected) / (1.0f - probability);
        if (material.thin) {
            i.z = -i.z;
        } else {
            i = (cos_o / eta - cos_t) * h - o / eta;
            *weight /= eta * eta;
        }
    }
    const int right_side = u.z >= probability ? i.z < 0.0f : i.z > 0.0f;
    const float masked = material.alpha > 0.0f ? 2.0f * fabs(i.z) / (fabs(i.z) + ggx_slope(i, material.alpha)) : 1.0f;
    *weight = right_side ? *weight * masked : (float3)(0.0f);
    return i;
}

#endif
