// Reflected radiance of the objects' voxels, as diffuse surfaces that the area lights light, with shadow maps of
// objects and real surfaces (T. A. Franke, "Delta Voxel Cone Tracing", section 3.2: injection on objects).
//
// in   object            lib/trace/voxels.h
//      area_lights       area_lights.h
//      surface, facing   trace/voxelize_objects.cl
// out  light             the finest level
#include "area_lights.h"
#include "trace/object_voxels.h"

__kernel void inject_objects(
    const Voxels objects,
    const AreaLights lights,
    __global const float4 *restrict surface,
    __global const float4 *restrict facing,
    __global float4 *restrict light)
{
    const int4 size = objects.levels[0];
    const int i = get_global_id(0);
    if (i >= size.x * size.y * size.z)
        return;
    const ObjectVoxel voxel = object_voxel(objects, surface, facing, i);
    float3 arriving = (float3)(0.0f);
    for (int number = 0; number < (voxel.filled ? lights.count : 0); number++) {
        const AreaLight from = area_light(lights.rows, number);
        const float3 sent = light_irradiance(from, voxel.p, voxel.n);
        if (sent.x + sent.y + sent.z > 0.0f)
            arriving +=
                light_passing(lights, number, from, voxel.p, VOXEL_SLACK * objects.box.w).y * sent;
    }
    light[i] = reflected_light(voxel, arriving, 1);
}
