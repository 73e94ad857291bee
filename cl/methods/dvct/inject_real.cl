// Voxels of the real surfaces around the objects, with antiradiance where the objects cast shadows (T. A. Franke,
// "Delta Voxel Cone Tracing", section 3.2).
//
// Antiradiance is negative radiance: minus the panorama's radiance times the share of the surface's irradiance
// that objects block.
//
// in   panorama          lib/world/real/real.h
//      prefiltered       lib/trace/prefiltered.h
//      area_lights       area_lights.h
//      levels, box       lib/trace/voxels.h
// out  opacity, light    the finest level; radiance is 0 or less
#include "area_lights.h"
#include "trace/prefiltered.h"
#include "trace/real_voxels.h"

__kernel void inject_real(
    const int real_width,
    const int real_height,
    __global const float4 *restrict real_surface,
    const Prefiltered panorama,
    const AreaLights lights,
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
    float3 without = (float3)(0.0f), with = (float3)(0.0f);
    const int shadowed = voxel.solid && !voxel.opening;
    for (int number = 0; number < (shadowed ? lights.count : 0); number++) {
        const AreaLight from = area_light(lights.rows, number);
        const float3 sent = light_irradiance(from, voxel.nearest, voxel.n);
        if (!(sent.x + sent.y + sent.z > 0.0f))
            continue;
        const float2 passing =
            light_passing(lights, number, from, voxel.nearest, VOXEL_SLACK * box.w);
        without += passing.x * sent;
        with += passing.y * sent;
    }
    float3 change = (float3)(0.0f);
    if (without.x > with.x || without.y > with.y || without.z > with.z) {
        change = (with - without) / fmax(without, 1e-30f)
            * prefiltered_radiance(panorama, voxel.p, box.w / length(voxel.p));
    }
    opacity[i] = voxel.solid ? (float4)(1.0f, 1.0f, 1.0f, 0.0f) : (float4)(0.0f);
    light[i] = (float4)(change, voxel.solid ? 1.0f : 0.0f);
}
