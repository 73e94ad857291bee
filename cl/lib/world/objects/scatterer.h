// A surface point of a virtual object that scatters, seen along d.
#pragma once

typedef struct {
    float3 position;   // just off the surface: rays from it do not meet it
    float3 normal;     // towards the viewer
    float3 albedo;
    int material;
    float2 finish;     // of a principled material: metalness, and alpha of GGX; negative: the material's means
#ifdef EMISSION
    float3 emission;   // radiance; negative: the material's mean
    float facing;      // cosine between the ray and the plane of the triangle
#endif
} Scatterer;
