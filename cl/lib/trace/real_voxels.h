// Voxels of the panorama's surfaces: a voxel is solid if a surface intersects it or lies up to one voxel
// in front of it.
#pragma once

#include "maths/equirect.h"
#include "trace/voxels.h"
#include "world/real/real.h"

typedef struct {
    int solid;
    int opening;      // the surface is a window
    float3 p;         // centre of the voxel, metres
    float3 nearest;   // the nearest point of the surface
    float3 n;         // its normal, towards the capture centre
} RealVoxel;

// Return voxel i of a level of `size`; `box` is the grid's lower corner and the width of a voxel.
static inline RealVoxel real_voxel(__global const float4 *restrict surfaces, int width, int height,
                                   int4 size, float4 box, int i)
{
    RealVoxel voxel;
    voxel.p = voxel_middle(size, box, i);
    const float4 surface = surfaces[equirect_texel(equirect_uv(voxel.p), width, height)];
    const float inverse = rsqrt(fmax(dot(surface.xyz, surface.xyz), 1e-30f));
    const float behind = (dot(surface.xyz, voxel.p) - 1.0f) * inverse;
    const float reach = 0.5f * box.w * dot(fabs(surface.xyz), (float3)(1.0f)) * inverse;
    voxel.solid =
        !((int)surface.w & SURFACE_NONE) && behind >= -reach && behind < reach + box.w;
    voxel.opening = voxel.solid && (int)surface.w & SURFACE_OPENING;
    voxel.n = -inverse * surface.xyz;
    voxel.nearest = voxel.p + behind * voxel.n;
    return voxel;
}
