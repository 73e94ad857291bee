// The panorama's surfaces as voxels: those that a surface goes through, or lies up to a voxel before. They
// are opaque, and send what the panorama shows there (K. Rohmer et al., "Natural Environment
// Illumination", section 6.1). Open sky is none. With -D OPENING_ENVIRONMENT windows send nothing: what
// they show depends on the direction of the cone.
//
// in   panorama          lib/world/scene.h
//      prefiltered       lib/methods/prefiltered.h
//      levels, box       lib/methods/voxels.h
// out  opacity, light    the finest level
#include "methods/prefiltered.h"
#include "world/real/real.h"

__kernel void voxelize_real(
    const int real_width,
    const int real_height,
    __global const float4 *restrict real_surface,
    PREFILTERED_PARAMETERS,
    __global const int4 *restrict levels,
    const float4 box,
    __global float4 *restrict opacity,
    __global float4 *restrict light)
{
    const int4 size = levels[0];
    const int i = get_global_id(0);
    if (i >= size.x * size.y * size.z)
        return;
    const float3 p = box.xyz
        + box.w * ((float3)(i % size.x, i / size.x % size.y, i / (size.x * size.y)) + 0.5f);
    const float2 uv = equirect_uv(p);
    const int column = min((int)(uv.x * real_width), real_width - 1);
    const int row = min((int)(uv.y * real_height), real_height - 1);
    const float4 surface = real_surface[row * real_width + column];
    const float inverse = rsqrt(fmax(dot(surface.xyz, surface.xyz), 1e-30f));
    const float behind = (dot(surface.xyz, p) - 1.0f) * inverse;
    const float reach = 0.5f * box.w * dot(fabs(surface.xyz), (float3)(1.0f)) * inverse;
    const int solid =
        !((int)surface.w & SURFACE_NONE) && behind >= -reach && behind < reach + box.w;
    const Prefiltered panorama = PREFILTERED;
    float3 radiance = (float3)(0.0f);
    float open = 0.0f;
#ifdef OPENING_ENVIRONMENT
    open = solid && (int)surface.w & SURFACE_OPENING ? 1.0f : 0.0f;
#endif
    if (solid && open == 0.0f)
        radiance = prefiltered_radiance(panorama, p, box.w / length(p));
    opacity[i] = solid ? (float4)(1.0f, 1.0f, 1.0f, open) : (float4)(0.0f);
    light[i] = (float4)(radiance, solid ? 1.0f : 0.0f);
}
