// Voxels of the objects as diffuse surfaces.
#pragma once

#include "maths/maths.h"
#include "trace/voxels.h"

typedef struct {
    int filled;       // a surface intersects it
    float3 p;         // centre of the voxel, metres
    float3 n;         // mean normal of its surfaces
    float4 met;       // trace/voxelize_objects.cl
    float weight;     // mean opacity along the axes
} ObjectVoxel;

// Return voxel i of the finest level; `surface` and `facing` are of trace/voxelize_objects.cl.
static inline ObjectVoxel object_voxel(const Voxels objects, __global const float4 *restrict surface,
                                       __global const float4 *restrict facing, int i)
{
    const float3 opacity = objects.opacity[i].xyz;
    ObjectVoxel voxel;
    voxel.met = surface[i];
    voxel.filled = voxel.met.w > 0.0f;
    voxel.p = voxel_middle(objects.levels[0], objects.box, i);
    voxel.n = safe_normalize(facing[i].xyz, (float3)(0.0f, 1.0f, 0.0f));
    voxel.weight = (opacity.x + opacity.y + opacity.z) * (1.0f / 3.0f);
    return voxel;
}

// Return its entry of `light`: the radiance that it reflects of the sum `arriving` of `count` samples of
// irradiance / pi, and its weight.
static inline float4 reflected_light(const ObjectVoxel voxel, float3 arriving, int count)
{
    if (!voxel.filled)
        return (float4)(0.0f);
    return (float4)(voxel.weight / (voxel.met.w * count) * voxel.met.xyz * arriving, voxel.weight);
}
