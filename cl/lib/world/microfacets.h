// GGX microfacets and the Fresnel equations, for directions in the frame of the normal. Sources: lib/world/brdf.h.
#pragma once

#include "maths/equirect.h"
#include "maths/maths.h"
#include "maths/sampling.h"

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

// Return the fifth power of 1 - cosine, by which Schlick's approximation rises towards grazing incidence: "An
// Inexpensive BRDF Model for Physically-based Rendering", 1994, equation 15.
static inline float schlick_rise(float cosine)
{
    const float grazing = 1.0f - clamp(cosine, 0.0f, 1.0f), grazing2 = grazing * grazing;
    return grazing2 * grazing2 * grazing;
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

// Return the cosine between either direction and their half vector.
static inline float half_cosine(float3 i, float3 o)
{
    const float3 h = i + o;
    return dot(o, h) / sqrt(dot(h, h));
}

// Return the reflection of light, in 1/sr, by microfacets that reflect all of it.
static inline float ggx_reflection(float3 i, float3 o, float alpha)
{
    // G2 / (4 cos_i cos_o), which stays finite at grazing angles.
    const float visible = 0.5f / (ggx_slope(o, alpha) * i.z +
                                  ggx_slope(i, alpha) * o.z);
    return ggx_distribution(i, o, alpha) * visible;
}

// Return the density of i, in 1/sr, among reflections by the normals that ggx_sample_normal() returns with a
// probability.
static inline float ggx_density(float probability, float3 i, float3 o, float alpha)
{
    return probability * ggx_distribution(i, o, alpha) /
           (2.0f * (o.z + ggx_slope(o, alpha)));
}
