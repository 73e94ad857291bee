// Voxelization of the panorama's surfaces (lib/trace/real_voxels.h). The voxels are opaque and have the
// panorama's radiance (K. Rohmer et al., "Natural Environment Illumination", section 6.1). Open sky has no
// voxels. With -D OPENING_ENVIRONMENT windows emit nothing: their radiance depends on the cone's direction.
//
// in   panorama          lib/world/real/real.h
//      prefiltered       lib/trace/prefiltered.h
//      levels, box       lib/trace/voxels.h
// out  opacity, light    the finest level
#include "trace/prefiltered.h"
#include "trace/real_voxels.h"

__kernel void voxelize_real(
    const int real_width,
    const int real_height,
    __global const float4 *restrict real_surface,
    const Prefiltered panorama,
    __global const int4 *restrict levels,
    const float4 box,
    __global float4 *restrict opacity,
    __global float4 *restrict light)
{
    const int4 size = levels[0];
    const int i = get_global_id(0);
    if (i >= size.x * size.y * size.z)
        return;
    const RealVoxel voxel = real_voxel(real_surface, real_width, real_height, size, box, i);
    float3 radiance = (float3)(0.0f);
    float open = 0.0f;
#ifdef OPENING_ENVIRONMENT
    open = voxel.opening ? 1.0f : 0.0f;
#endif
    if (voxel.solid && open == 0.0f)
        radiance = prefiltered_radiance(panorama, voxel.p, box.w / length(voxel.p));
    opacity[i] = voxel.solid ? (float4)(1.0f, 1.0f, 1.0f, open) : (float4)(0.0f);
    light[i] = (float4)(radiance, voxel.solid ? 1.0f : 0.0f);
}
