// Layers above a principled material, -D COVERED: a clearcoat, and sheen below it (Khronos glTF extensions
// KHR_materials_clearcoat and KHR_materials_sheen), and the tint of its plastic's coat (KHR_materials_specular).
//
// All directions are in the frame of the normal. Pairs of cosines are at the normals of the clearcoat (x) and of the
// surface (y), which are the same but with -D COAT_NORMALS. `cover` points to row COVER_ROW of a material:
//   row 0      clearcoat, its alpha (GGX; 0: smooth); alpha of the sheen; index of the material of which this is a
//              variant (material.h)
//   row 1      sheen, rgb; its greatest channel
//   row 2      tint of the coat at normal incidence, rgb
//   rows 3-10  share of light that the clearcoat reflects at cosines (i / 31)^2, i = 0..31
//   rows 11-18 the same of white sheen, without its limit
//
// A layer lets pass the share of light that it does not reflect, at the cosine of the viewer or of the light where it
// reflects more. This is reciprocal, and all together reflect no more light than arrives.
//
// Sources. Sheen: A. Estevez and C. Kulla, "Production Friendly Microfacet Sheen BRDF", 2017, with the visibility of
// D. Neubelt and M. Pettineo, "Crafting a Next-Gen Material Pipeline for The Order: 1886", 2013. Smooth sheen would
// reflect more light than arrives at grazing angles; it is divided by the share that it would reflect.
#pragma once

#include "world/microfacets.h"

#define COVER_ROW 11
#define COVER_NODES 32
#define CLEARCOAT_REFLECTANCE 12
#define SHEEN_REFLECTANCE 44
// Index of refraction of clearcoats.
#define CLEARCOAT_IOR 1.5f
// Least alpha of sheen: less reflects light at grazing angles alone.
#define MIN_SHEEN_ALPHA 0.01f

static inline float clearcoat_strength(__global const float *cover) { return cover[0]; }
static inline float clearcoat_alpha(__global const float *cover) { return cover[1]; }
static inline float greatest_sheen(__global const float *cover) { return cover[7]; }

// Return a value of one of the tables.
static inline float reflected_share(__global const float *table, float cosine)
{
    const float x = sqrt(cosine) * (COVER_NODES - 1);
    const int i = min((int)x, COVER_NODES - 2);
    return mix(table[i], table[i + 1], x - (float)i);
}

// Return the share of light that the clearcoat reflects (x), and that white sheen would (y).
static inline float2 cover_reflectance(__global const float *cover, float2 cosines)
{
    return (float2)(cover[0] * reflected_share(cover + CLEARCOAT_REFLECTANCE, cosines.x),
                    reflected_share(cover + SHEEN_REFLECTANCE, cosines.y));
}

// Return cover_reflectance() of the direction in which more is reflected.
static inline float2 most_reflected(__global const float *cover, float2 cos_i, float2 cos_o)
{
    return fmax(cover_reflectance(cover, cos_i), cover_reflectance(cover, cos_o));
}

// Return the share of light that reaches the material below both layers and returns.
static inline float below_cover(__global const float *cover, float2 cos_i, float2 cos_o)
{
    const float2 most = most_reflected(cover, cos_i, cos_o);
    return (1.0f - most.x) * (1.0f - greatest_sheen(cover) * fmin(most.y, 1.0f));
}

// Return the sheen in 1/sr, seen through the clearcoat.
static inline float3 sheen_reflection(
    __global const float *cover, float3 i, float3 o, float2 cos_i, float2 cos_o)
{
    const float2 most = most_reflected(cover, cos_i, cos_o);
    const float3 h = i + o;
    const float sine2 = (h.x * h.x + h.y * h.y) / dot(h, h), power = 1.0f / cover[2];
    const float distribution = (2.0f + power) * exp2(0.5f * power * log2(fmax(sine2, 1e-20f))) / (2.0f * IPRT_PI);
    const float visible = 0.25f / (i.z + o.z - i.z * o.z);
    return (1.0f - most.x) * distribution * visible / fmax(most.y, 1.0f)
        * (float3)(cover[4], cover[5], cover[6]);
}

// Return the probabilities of sampling sheen (x), if the clearcoat is not chosen, and the clearcoat (y).
static inline float2 cover_probabilities(__global const float *cover, float2 cos_o, float least)
{
    const float2 share = cover_reflectance(cover, cos_o);
    const float sheen = greatest_sheen(cover) > 0.0f ? clamp(greatest_sheen(cover) * share.y, least, 1.0f - least) : 0.0f;
    return (float2)(sheen, cover[0] > 0.0f ? clamp(share.x, least, 1.0f - least) : 0.0f);
}

// Return the factor of the coat's reflection: its tint, which fades towards grazing incidence.
static inline float3 coat_tint(__global const float *cover, float cos_h)
{
    return mix((float3)(cover[8], cover[9], cover[10]), (float3)(1.0f), schlick_rise(cos_h));
}
