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
// -D GLASS adds dielectrics, of which these functions have the reflection only. The rest: lib/world/glass.h.
//
// Sources. GGX, Smith: Heitz, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs",
// JCGT 3(2), 2014, eq. 72 and 99 (height-correlated). Sampling: Dupuy and Benyoub, "Sampling Visible GGX
// Normals with Spherical Caps", HPG 2023. Plastic: a GGX dielectric coat on a Lambertian base with linear
// color, as Mitsuba 3 defines `roughplastic` and `plastic`.
#pragma once

#include "maths/equirect.h"
#include "maths/maths.h"
#include "maths/sampling.h"

// Layout of the table made by material_table(): MATERIAL_ROWS float4 per material.
//   row 0      kind, alpha (GGX; 0: perfectly smooth, else >= MIN_ALPHA), index of refraction,
//              1 / (ior^2 (1 - internal reflectance))
//   rows 1-8   rough transmittance of the coat at cosines (i / 31)^2, i = 0..31
//   row 9      metalness; index of the first of COAT_LEVELS further entries, coats of roughness
//              (i / (COAT_LEVELS - 1))^2 for maps of roughness, or 0; share of light that passes the base; 1 if
//              the surface is a thin wall
//   row 10     absorption in 1/m, rgb; priority of the medium
//   row 11     emitted radiance, rgb; the mean of its channels
#define MATERIAL_ROWS 12
#define FINISH_ROW 9
#define MEDIUM_ROW 10
#define MATERIAL_NODES 32
#define KIND_DIFFUSE 0
#define KIND_CONDUCTOR 1
#define KIND_PLASTIC 2
#define KIND_PRINCIPLED 3
#define KIND_DIELECTRIC 4
#define COAT_LEVELS 32

// Interpolated normals can turn away from the viewer: wo is bent to at least this cosine.
#define BRDF_MIN_COSINE 1e-3f
// Least share of the samples for either lobe of plastic. The reflection of the coat is faint, but a filter
// can blur it far less than the irradiance below it.
#define BRDF_MIN_LOBE 0.25f
// Least GGX roughness of surfaces that are not mirrors; single precision cannot resolve a narrower lobe.
#define MIN_ALPHA 1e-3f

typedef struct {
    int kind;
    float alpha;
    float ior;
    float base;                              // scale of the base below the coat, row 0's w
    __global const float *transmittance;     // MATERIAL_NODES values
#ifdef PRINCIPLED
    float metallic;
    float rougher;                           // share of the next rougher coat's values
#endif
#ifdef GLASS
    float transmission;                      // share of light that passes the base
    int thin;                                // a wall without inside
#endif
} Material;

// A direction sampled from one lobe. `weight` is f cos / density of that lobe, including the probability of
// having chosen it; 0 where the direction lies below the surface.
typedef struct {
    float3 wi;
    float3 weight;
    int specular;    // the lobe: weight excludes the albedo iff this is 0
} BrdfSample;

// BRDF f in 1/sr, without the cosine. Perfectly smooth lobes, which only sampling can find, are 0.
typedef struct {
    float diffuse;      // to be multiplied by the albedo
    float3 specular;
} BrdfValue;

static inline Material load_material(__global const float4 *restrict materials, int index)
{
    __global const float *row = (__global const float *)(materials + index * MATERIAL_ROWS);
    Material material = {(int)row[0], row[1], row[2], row[3], row + 4};
#ifdef PRINCIPLED
    material.metallic = row[4 * FINISH_ROW];
    material.rougher = 0.0f;
#endif
#ifdef GLASS
    material.transmission = row[4 * FINISH_ROW + 2];
    material.thin = row[4 * FINISH_ROW + 3] > 0.0f;
#endif
    return material;
}

// Return a material with the finish of a point of a surface: its metalness and alpha. A negative one stands for the
// means of the material.
static inline Material load_surface_material(
    __global const float4 *restrict materials, int index, float2 finish)
{
    Material material = load_material(materials, index);
#ifdef PRINCIPLED
    if (material.kind != KIND_PRINCIPLED || finish.x < 0.0f)
        return material;
    const int levels = (int)material.transmittance[MATERIAL_NODES + 1];
    if (levels > 0) {
        const float at = sqrt(clamp(finish.y, 0.0f, 1.0f)) * (COAT_LEVELS - 1);
        const int level = min((int)at, COAT_LEVELS - 2);
        const Material next = load_material(materials, levels + level + 1);
#ifdef GLASS
        const float transmission = material.transmission;
        const int thin = material.thin;
#endif
        material = load_material(materials, levels + level);
#ifdef GLASS
        material.transmission = transmission;
        material.thin = thin;
#endif
        material.rougher = at - level;
        material.base = mix(material.base, next.base, material.rougher);
        material.alpha = fmax(finish.y, MIN_ALPHA);
    }
    material.metallic = finish.x;
#endif
    return material;
}

// Return the factor of the diffuse lobe.
static inline float3 diffuse_albedo(const Material material, float3 albedo)
{
#ifdef PRINCIPLED
    albedo *= 1.0f - material.metallic;
#endif
    return albedo;
}

// Return whether a material has no diffuse lobe.
static inline int is_specular(const Material material)
{
#ifdef PRINCIPLED
    if (material.kind == KIND_PRINCIPLED)
        return !(material.metallic < 1.0f);
#endif
#ifdef GLASS
    if (material.kind == KIND_DIELECTRIC)
        return 1;
#endif
    return material.kind == KIND_CONDUCTOR;
}

// Return whether a material has a diffuse base below a dielectric coat.
static inline int is_coated(const Material material)
{
#ifdef PRINCIPLED
    if (material.kind == KIND_PRINCIPLED)
        return 1;
#endif
    return material.kind == KIND_PLASTIC;
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

// Return the unpolarized reflectance of a smooth dielectric boundary; `ior` is the index of refraction of the far side
// relative to the near one.
static inline float fresnel_dielectric(float cosine, float ior)
{
    const float c = fmax(cosine, 1e-6f);
    const float g = sqrt(fmax(ior * ior - 1.0f + c * c, 0.0f));
    const float s = (c - g) / (c + g);
    const float p = (ior * ior * c - g) / (ior * ior * c + g);
    return 0.5f * (s * s + p * p);
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
    const float3 coat = (float3)(fresnel_dielectric(cos_h, material.ior));
#ifdef PRINCIPLED
    // Schlick, "An Inexpensive BRDF Model for Physically-based Rendering", 1994, equation 15.
    const float grazing = 1.0f - clamp(cos_h, 0.0f, 1.0f), grazing2 = grazing * grazing;
    return mix(coat, mix(albedo, (float3)(1.0f), grazing2 * grazing2 * grazing), material.metallic);
#else
    return coat;
#endif
}

// Return z (1 + 2 Lambda(v)) of Smith's masking function.
static inline float ggx_slope(float3 v, float alpha)
{
    return sqrt(v.z * v.z + alpha * alpha * (v.x * v.x + v.y * v.y));
}

// Return the GGX distribution of normals at the half vector of i and o.
static inline float ggx_distribution(float3 i, float3 o, float alpha)
{
    // h is not normalized: its length cancels, and rounding errors are smaller for small alpha.
    const float3 h = i + o;
    const float a2 = alpha * alpha;
    const float spread = (h.x * h.x + h.y * h.y + a2 * h.z * h.z) / dot(h, h);
    return a2 / (IPRT_PI * spread * spread);
}

static inline float3 ggx_sample_normal(float3 o, float alpha, float2 u)
{
    float3 stretched = (float3)(alpha * o.x, alpha * o.y, o.z);
    stretched /= sqrt(dot(stretched, stretched));
    const float height = (1.0f - u.y) * (1.0f + stretched.z);   // > 0: z of the half vector
    const float z = height - stretched.z;
    const float2 disk = sqrt(fmax(1.0f - z * z, 0.0f)) * unit_circle(u.x);
    const float3 h = (float3)(alpha * (disk.x + stretched.x), alpha * (disk.y + stretched.y),
                              height);
    return h / sqrt(dot(h, h));
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
    const float probability = specular_probability(material, albedo, o.z);
    if (u.z < probability) {
        sample = sample_specular(material, albedo, frame, o, u.xy);
        sample.weight /= probability;
        return sample;
    }

    const float3 i = sample_cosine(u.xy);
    sample.wi = frame_to_world(frame, i);
    sample.weight = (float3)(diffuse_factor(material, i.z, o.z) / (1.0f - probability));
    return sample;
}

static inline BrdfValue brdf_eval(const Material material, float3 albedo, float3 n, float3 wo,
                                  float3 wi)
{
    const Frame frame = build_frame(n);
    const float3 o = brdf_local_wo(frame, wo);
    const float3 i = frame_to_local(frame, wi);
    BrdfValue value = {0.0f, (float3)(0.0f)};
    if (!(i.z > 0.0f))
        return value;
    if (!is_specular(material))
        value.diffuse = diffuse_factor(material, i.z, o.z) / IPRT_PI;
    if (material.kind != KIND_DIFFUSE && material.alpha > 0.0f) {
        // G2 / (4 cos_i cos_o), which stays finite at grazing angles.
        const float visible = 0.5f / (ggx_slope(o, material.alpha) * i.z +
                                      ggx_slope(i, material.alpha) * o.z);
        const float3 h = i + o;
        const float cos_h = dot(o, h) / sqrt(dot(h, h));
        value.specular = specular_reflectance(material, albedo, cos_h) *
                         (ggx_distribution(i, o, material.alpha) * visible);
    }
    return value;
}

// Return the densities (1/sr) with which brdf_sample() samples wi by the diffuse (x) and the specular lobe
// (y), including the lobes' probabilities: x + y is the density of the mixture. The specular lobe may
// sample directions below the surface with weight 0; their density here is 0.
static inline float2 brdf_pdf(const Material material, float3 albedo, float3 n, float3 wo,
                              float3 wi)
{
    const Frame frame = build_frame(n);
    const float3 i = frame_to_local(frame, wi);
    float2 density = (float2)(0.0f);
    if (!(i.z > 0.0f))
        return density;
    const float3 o = brdf_local_wo(frame, wo);
    const float probability = specular_probability(material, albedo, o.z);
    if (material.kind != KIND_DIFFUSE && material.alpha > 0.0f)
        density.y = probability * ggx_distribution(i, o, material.alpha) /
                    (2.0f * (o.z + ggx_slope(o, material.alpha)));
    density.x = (1.0f - probability) * i.z / IPRT_PI;
    return density;
}
