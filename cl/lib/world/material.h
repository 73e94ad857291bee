// Materials of surfaces, iprt/geometry/material.py: the table of them, loading, and their lobes.
//
// -D PRINCIPLED adds the principled material, whose parameters may vary over a surface. -D COVERED, with it, adds the
// layers above it, -D COAT_NORMALS, with that, a normal of its clearcoat, and -D GLASS dielectrics. -D VARIANTS: other
// values of some vary over a surface, whose variants are materials of their own, with their own indices.
#pragma once

#include "world/cover.h"
#include "world/finish.h"

// Layout of the table made by material_table(): MATERIAL_ROWS float4 per material.
//   row 0      kind, alpha (GGX; 0: perfectly smooth, else >= MIN_ALPHA), index of refraction,
//              1 / (ior^2 (1 - internal reflectance))
//   rows 1-8   rough transmittance of the coat at cosines (i / 31)^2, i = 0..31
//   row 9      metalness; index of the first of COAT_LEVELS further entries, coats of roughness
//              (i / (COAT_LEVELS - 1))^2 for maps of roughness, or 0; share of light that passes the base; 1 if
//              the surface is a thin wall
//   row 10     absorption in 1/m, rgb; priority of the medium
//   rows 11-29 cover: lib/world/cover.h
//   row 30     emitted radiance, rgb; the mean of its channels
#define MATERIAL_ROWS 31
#define FINISH_ROW 9
#define MEDIUM_ROW 10
#define MATERIAL_NODES 32
#define KIND_DIFFUSE 0
#define KIND_CONDUCTOR 1
#define KIND_PLASTIC 2
#define KIND_PRINCIPLED 3
#define KIND_DIELECTRIC 4
#define COAT_LEVELS 32

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
#ifdef COVERED
    __global const float *cover;             // the rows of lib/world/cover.h
#endif
#ifdef COAT_NORMALS
    float3 coat_normal;                      // of the clearcoat, in the frame of the shading normal
#endif
} Material;

// Return the index of the material of which a material is a variant, or its own.
static inline int without_variant(__global const float4 *restrict materials, int index)
{
    return (int)materials[index * MATERIAL_ROWS + COVER_ROW].w;
}

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
#ifdef COVERED
    material.cover = row + 4 * COVER_ROW;
#endif
#ifdef COAT_NORMALS
    material.coat_normal = (float3)(0.0f, 0.0f, 1.0f);
#endif
    return material;
}

// Return a material with the finish of a point of a surface.
static inline Material load_surface_material(
    __global const float4 *restrict materials, int index, Finish finish)
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
#ifdef COVERED
        __global const float *cover = material.cover;
#endif
        material = load_material(materials, levels + level);
#ifdef GLASS
        material.transmission = transmission;
        material.thin = thin;
#endif
#ifdef COVERED
        material.cover = cover;
#endif
        material.rougher = at - level;
        material.base = mix(material.base, next.base, material.rougher);
        material.alpha = fmax(finish.y, MIN_ALPHA);
    }
    material.metallic = finish.x;
#endif
#ifdef COAT_NORMALS
    material.coat_normal = unpacked_coat_normal(finish.zw);
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

// Return the alpha of the widest reflection without albedo or of sheen, which counts as 1.
static inline float widest_alpha(const Material material)
{
    float alpha = material.alpha;
#ifdef COVERED
    alpha = clearcoat_strength(material.cover) > 0.0f ? fmax(alpha, clearcoat_alpha(material.cover)) : alpha;
    alpha = greatest_sheen(material.cover) > 0.0f ? 1.0f : alpha;
#endif
    return alpha;
}
