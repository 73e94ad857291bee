// BRDFs of the materials in iprt/geometry/material.py: evaluation, sampling, density.
//
// All directions are unit vectors that point away from the surface: wo to the viewer, wi to the light; n is
// the shading normal. A BRDF has two lobes that callers accumulate separately:
//   diffuse    WITHOUT the diffuse albedo, so that irradiance can be filtered and the albedo multiplied
//              afterwards
//   specular   complete: a conductor's reflectance (its albedo) or a coat's Fresnel term included
//
// -D PRINCIPLED adds the principled material, a mixture of a plastic and a metal whose base color is the albedo
// (Khronos glTF 2.0, appendix B). Its parameters may vary over a surface: load_surface_material().
// -D COVERED, with it, adds layers above it: lib/world/cover.h. -D COAT_NORMALS, with that, gives the clearcoat a
// normal of its own, above whose plane it reflects light, also below the shading normal's. Its f is the f in its own
// frame times the ratio of the cosines at its own and at the shading normal, which is not reciprocal.
// -D GLASS adds dielectrics, of which these functions have the reflection only. The rest: lib/world/glass.h.
//
// Sources. GGX, Smith: Heitz, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs",
// JCGT 3(2), 2014, eq. 72 and 99 (height-correlated). Sampling: Dupuy and Benyoub, "Sampling Visible GGX
// Normals with Spherical Caps", HPG 2023. Plastic: a GGX dielectric coat on a Lambertian base with linear
// color, as Mitsuba 3 defines `roughplastic` and `plastic`.
#pragma once

#include "world/cover.h"
#include "world/material.h"
#include "world/microfacets.h"

// Interpolated normals can turn away from the viewer: wo is bent to at least this cosine.
#define BRDF_MIN_COSINE 1e-3f
// Least share of the samples for either lobe of plastic. The reflection of the coat is faint, but a filter
// can blur it far less than the irradiance below it.
#define BRDF_MIN_LOBE 0.25f
// Least cosine by which the reflection of a clearcoat with its own normal is divided.
#define COAT_MIN_COSINE 1e-5f

// A direction sampled from one lobe. `weight` is f cos / density of that lobe, including the probability of
// having chosen it; 0 where the direction lies below the plane of the lobe. Where sheen is sampled with the diffuse
// lobe, it is not in the weight, only in brdf_eval().
typedef struct {
    float3 wi;
    float3 weight;
    int specular;    // the lobe: weight excludes the albedo iff this is 0; MIRRORED (-D COVERED): it is smooth
} BrdfSample;

#define MIRRORED 2

// BRDF f in 1/sr, without the cosine. Perfectly smooth lobes, which only sampling can find, are 0.
typedef struct {
    float diffuse;      // to be multiplied by the albedo
    float3 specular;
} BrdfValue;

// Return whether a sample is of a perfectly smooth lobe: it has a weight, and no density.
static inline int is_mirrored(const Material material, const BrdfSample sample)
{
#ifdef COVERED
    return sample.specular == MIRRORED;
#else
    return sample.specular && !(material.alpha > 0.0f);
#endif
}

// Return whether light from below the shading normal's plane may be reflected.
static inline int reflects_below(void)
{
#ifdef COAT_NORMALS
    return 1;
#else
    return 0;
#endif
}

// Return the cosine at the shading normal by which f of brdf_eval() is multiplied.
static inline float brdf_cosine(float3 n, float3 wi)
{
    const float cosine = dot(n, wi);
    return reflects_below() ? fmax(fabs(cosine), COAT_MIN_COSINE) : fmax(cosine, 0.0f);
}

static inline float3 brdf_local_wo(Frame frame, float3 wo)
{
    float3 o = frame_to_local(frame, wo);
    o.z = fmax(o.z, BRDF_MIN_COSINE);
    return o / sqrt(dot(o, o));
}

// Return the transmittance of the rough coat for a direction at this cosine.
static inline float coat_transmittance(const Material material, float cosine)
{
    const float x = sqrt(cosine) * (MATERIAL_NODES - 1);
    const int i = min((int)x, MATERIAL_NODES - 2);
    float crossed = mix(material.transmittance[i], material.transmittance[i + 1], x - (float)i);
#ifdef PRINCIPLED
    __global const float *next = material.transmittance + 4 * MATERIAL_ROWS;
    if (material.rougher > 0.0f)
        crossed = mix(crossed, mix(next[i], next[i + 1], x - (float)i), material.rougher);
#endif
    return crossed;
}

// Return the probability of sampling the specular lobe: its share of the reflected luminance.
static inline float specular_probability(const Material material, float3 albedo, float cos_o)
{
    if (is_specular(material))
        return 1.0f;
    if (!is_coated(material))
        return 0.0f;
    const float crossed = coat_transmittance(material, cos_o);
    float specular = 1.0f - crossed;
    float diffuse = luminance(albedo) * material.base * crossed;
#ifdef PRINCIPLED
    specular = mix(specular, luminance(albedo), material.metallic);
    diffuse *= 1.0f - material.metallic;
#endif
    const float share = specular / fmax(specular + diffuse, 1e-6f);
    return clamp(share, BRDF_MIN_LOBE, 1.0f - BRDF_MIN_LOBE);
}

static inline float3 specular_reflectance(const Material material, float3 albedo, float cos_h)
{
#ifdef GLASS
    if (material.kind == KIND_DIELECTRIC)
        return (float3)(fresnel_dielectric(cos_h, material.ior));
#endif
    if (!is_coated(material))
        return albedo;
    float3 coat = (float3)(fresnel_dielectric(cos_h, material.ior));
#ifdef COVERED
    if (material.kind == KIND_PRINCIPLED)
        coat *= coat_tint(material.cover, cos_h);
#endif
#ifdef PRINCIPLED
    return mix(coat, mix(albedo, (float3)(1.0f), schlick_rise(cos_h)), material.metallic);
#else
    return coat;
#endif
}

// Return pi times the diffuse lobe, without the albedo.
static inline float diffuse_factor(const Material material, float cos_i, float cos_o)
{
    if (is_coated(material))
        return coat_transmittance(material, cos_i) * coat_transmittance(material, cos_o) *
               material.base;
    return 1.0f;
}

// Sample the specular lobe alone; u in [0, 1)^2, o towards the viewer, in the frame of n.
static inline BrdfSample sample_specular(const Material material, float3 albedo, const Frame frame,
                                         float3 o, float2 u)
{
    float3 h = (float3)(0.0f, 0.0f, 1.0f);
    if (material.alpha > 0.0f)
        h = ggx_sample_normal(o, material.alpha, u);
    const float cos_h = dot(o, h);
    const float3 i = 2.0f * cos_h * h - o;
    float unshadowed = i.z > 0.0f ? 1.0f : 0.0f;
    if (i.z > 0.0f && material.alpha > 0.0f) {   // G2 / G1(o)
        const float slope_o = ggx_slope(o, material.alpha);
        const float slope_i = ggx_slope(i, material.alpha);
        unshadowed = i.z * (o.z + slope_o) / (slope_o * i.z + slope_i * o.z);
    }
    BrdfSample sample;
    sample.specular = 1;
#ifdef COVERED
    sample.specular = material.alpha > 0.0f ? 1 : MIRRORED;
#endif
    sample.wi = frame_to_world(frame, i);
    sample.weight = specular_reflectance(material, albedo, cos_h) * unshadowed;
    return sample;
}

// Return the mirror direction of o with the weight of the whole lobe around it. `solid_angle` gets the
// solid angle of a uniform cone with the lobe's density there: the inverse of the density of
// sample_specular().
static inline BrdfSample mirrored_lobe(const Material material, float3 albedo, const Frame frame, float3 o,
                                       float *solid_angle)
{
    BrdfSample sample;
    sample.specular = 1;
    sample.wi = frame_to_world(frame, (float3)(-o.x, -o.y, o.z));
    const float slope = ggx_slope(o, material.alpha);
    const float unshadowed = 0.5f * (o.z + slope) / slope;
    *solid_angle = 2.0f * IPRT_PI * material.alpha * material.alpha * (o.z + slope);
    sample.weight = specular_reflectance(material, albedo, o.z) * unshadowed;
    return sample;
}

// Return the probabilities of sampling the specular lobe (x) and the clearcoat (y); of the rest, directions are sampled
// by the cosine. Cosines as in lib/world/cover.h.
static inline float2 lobe_probabilities(const Material material, float3 albedo, float2 cos_o)
{
    float2 probability = (float2)(specular_probability(material, albedo, cos_o.y), 0.0f);
#ifdef COVERED
    const float2 cover = cover_probabilities(material.cover, cos_o, BRDF_MIN_LOBE);
    probability.x *= (1.0f - cover.x) * (1.0f - cover.y);
    probability.y = cover.y;
#endif
    return probability;
}

#ifdef COVERED
// Return the clearcoat of a material, at full strength, as if it were a plastic's coat.
static inline Material clearcoat_of(const Material material)
{
    Material coat = material;
    coat.kind = KIND_PLASTIC;
    coat.alpha = clearcoat_alpha(material.cover);
    coat.ior = CLEARCOAT_IOR;
    coat.metallic = 0.0f;
    return coat;
}

// Return the cosines of a direction in the frame of the shading normal, as in lib/world/cover.h.
static inline float2 cover_cosines(const Material material, float3 v)
{
#ifdef COAT_NORMALS
    return (float2)(fmax(dot(v, material.coat_normal), 0.0f), v.z);
#else
    return (float2)(v.z);
#endif
}

// Return the clearcoat's reflection in 1/sr, by directions in its frame; `cos_i`: at the shading normal.
static inline float clearcoat_reflection(const Material material, float3 i, float3 o, float cos_i)
{
    if (!(clearcoat_alpha(material.cover) > 0.0f) || (reflects_below() && !(i.z > 0.0f)))
        return 0.0f;
    const float f = clearcoat_strength(material.cover) * fresnel_dielectric(half_cosine(i, o), CLEARCOAT_IOR)
        * ggx_reflection(i, o, clearcoat_alpha(material.cover));
    return reflects_below() ? f * i.z / fmax(fabs(cos_i), COAT_MIN_COSINE) : f;
}
#endif

// Return the normal of the clearcoat in the space of `frame`, which is the shading normal's.
static inline float3 coat_normal_of(const Material material, const Frame frame)
{
#ifdef COAT_NORMALS
    return frame_to_world(frame, material.coat_normal);
#else
    return frame.z;
#endif
}

// Sample the BRDF: u.z chooses a lobe and u.xy a direction in it; u in [0, 1)^3.
static inline BrdfSample brdf_sample(const Material material, float3 albedo, float3 n, float3 wo,
                                     float3 u)
{
    const Frame frame = build_frame(n);
    BrdfSample sample;
    sample.specular = 0;
    sample.wi = n;
    sample.weight = (float3)(0.0f);

    const float3 o = brdf_local_wo(frame, wo);
    const float3 coat_normal = coat_normal_of(material, frame);
    const float3 coat_o = brdf_local_wo(build_frame(coat_normal), wo);
    const float2 cos_o = (float2)(coat_o.z, o.z);
    const float2 probability = lobe_probabilities(material, albedo, cos_o);
#ifdef COVERED
    if (u.z < probability.x + probability.y) {
        const int coat = u.z >= probability.x;
        const Frame own = build_frame(coat ? coat_normal : n);
        sample = sample_specular(coat ? clearcoat_of(material) : material, albedo, own, coat ? coat_o : o, u.xy);
        float3 i = frame_to_local(frame, sample.wi);
        i.z = clamp(i.z, 0.0f, 1.0f);
        const float2 cos_i = cover_cosines(material, i);
        sample.weight *= coat ? clearcoat_strength(material.cover) / probability.y
                              : below_cover(material.cover, cos_i, cos_o) / probability.x;
        return sample;
    }
#else
    if (u.z < probability.x) {
        sample = sample_specular(material, albedo, frame, o, u.xy);
        sample.weight /= probability.x;
        return sample;
    }
#endif

    const float3 i = sample_cosine(u.xy);
    sample.wi = frame_to_world(frame, i);
    sample.weight = (float3)(diffuse_factor(material, i.z, o.z) / (1.0f - probability.x - probability.y));
#ifdef COVERED
    sample.weight *= below_cover(material.cover, cover_cosines(material, i), cos_o);
#endif
    return sample;
}

// Return brdf_eval() without the clearcoat's reflection, for directions in the frame of the normal, above its plane.
// Cosines as in lib/world/cover.h.
static inline BrdfValue value_below_coat(
    const Material material, float3 albedo, float3 i, float3 o, float2 cos_i, float2 cos_o)
{
    BrdfValue value = {0.0f, (float3)(0.0f)};
    if (!is_specular(material))
        value.diffuse = diffuse_factor(material, i.z, o.z) / IPRT_PI;
    if (material.kind != KIND_DIFFUSE && material.alpha > 0.0f)
        value.specular = specular_reflectance(material, albedo, half_cosine(i, o))
            * ggx_reflection(i, o, material.alpha);
#ifdef COVERED
    const float below = below_cover(material.cover, cos_i, cos_o);
    value.diffuse *= below;
    value.specular = below * value.specular + sheen_reflection(material.cover, i, o, cos_i, cos_o);
#endif
    return value;
}

static inline BrdfValue brdf_eval(const Material material, float3 albedo, float3 n, float3 wo,
                                  float3 wi)
{
    const Frame frame = build_frame(n);
    const float3 o = brdf_local_wo(frame, wo);
    const float3 i = frame_to_local(frame, wi);
    const int above = i.z > 0.0f;
    BrdfValue value = {0.0f, (float3)(0.0f)};
    if (!above && !reflects_below())
        return value;
    const Frame coat = build_frame(coat_normal_of(material, frame));
    const float3 coat_o = brdf_local_wo(coat, wo), coat_i = frame_to_local(coat, wi);
    const float2 cos_i = (float2)(reflects_below() ? fmax(coat_i.z, 0.0f) : i.z, i.z), cos_o = (float2)(coat_o.z, o.z);
    if (above)
        value = value_below_coat(material, albedo, i, o, cos_i, cos_o);
#ifdef COVERED
    value.specular += clearcoat_reflection(material, coat_i, coat_o, i.z);
#endif
    return value;
}

// Return the densities (1/sr) with which brdf_sample() samples wi by the diffuse (x) and the specular lobes
// (y), including the lobes' probabilities: x + y is the density of the mixture. The specular lobes may
// sample directions below the surface with weight 0; their density here is 0. With -D COAT_NORMALS it is not: another
// lobe may reflect light from there.
static inline float2 brdf_pdf(const Material material, float3 albedo, float3 n, float3 wo,
                              float3 wi)
{
    const Frame frame = build_frame(n);
    const float3 i = frame_to_local(frame, wi);
    const int above = i.z > 0.0f;
    float2 density = (float2)(0.0f);
    if (!above && !reflects_below())
        return density;
    const float3 o = brdf_local_wo(frame, wo);
    const Frame coat = build_frame(coat_normal_of(material, frame));
    const float3 coat_o = brdf_local_wo(coat, wo), coat_i = frame_to_local(coat, wi);
    const float2 probability = lobe_probabilities(material, albedo, (float2)(coat_o.z, o.z));
    // Half vectors of samples lie above the plane of their lobe.
    if (material.kind != KIND_DIFFUSE && material.alpha > 0.0f && (above || i.z + o.z > 0.0f))
        density.y = ggx_density(probability.x, i, o, material.alpha);
#ifdef COVERED
    if (clearcoat_alpha(material.cover) > 0.0f && (!reflects_below() || coat_i.z + coat_o.z > 0.0f))
        density.y += ggx_density(probability.y, coat_i, coat_o, clearcoat_alpha(material.cover));
#endif
    density.x = (1.0f - probability.x - probability.y) * (above ? i.z : 0.0f) / IPRT_PI;
    return density;
}
