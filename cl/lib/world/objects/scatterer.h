// A surface point of a virtual object that scatters, seen along d.
#pragma once

#include "world/finish.h"

// Rays pass through dielectrics.
#if defined(GLASS) && defined(OBJECTS_BVH)
#define REFRACTS
#endif

typedef struct {
    float3 position;   // just off the surface: rays from it do not meet it
    float3 normal;     // towards the viewer
    float3 albedo;
    int material;
    Finish finish;
#ifdef EMISSION
    float3 emission;   // radiance; negative: the material's mean
    float facing;      // cosine between the ray and the plane of the triangle
#endif
#ifdef REFRACTS
    float3 beyond;     // position just below the surface
    float3 plane;      // normal of the triangle, towards the viewer
    int enters;        // a ray along d enters the solid
#endif
} Scatterer;
