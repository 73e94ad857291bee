// Reflected radiance of the objects' voxels, as diffuse surfaces that the area lights light, with shadow maps of
// objects and real surfaces (T. A. Franke, "Delta Voxel Cone Tracing", section 3.2: injection on objects).
//
// in   object            lib/trace/voxels.h
//      area_lights       area_lights.h
//      surface, facing   trace/voxelize_objects.cl
// out  light             the finest level
#include "area_lights.h"
#include "trace/voxels.h"

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
    const float4 met = surface[i];
    if (!(met.w > 0.0f)) {
        light[i] = (float4)(0.0f);
        return;
    }
    const float3 n = safe_normalize(facing[i].xyz, (float3)(0.0f, 1.0f, 0.0f));
    const float3 p = voxel_middle(size, objects.box, i);
    float3 arriving = (float3)(0.0f);
    for (int number = 0; number < lights.count; number++) {
        const AreaLight from = area_light(lights.rows, number);
        const float3 sent = light_irradiance(from, p, n);
        if (sent.x + sent.y + sent.z > 0.0f)
            arriving += light_passing(lights, number, from, p, VOXEL_SLACK * objects.box.w).y * sent;
    }
    const float3 opacity = objects.opacity[i].xyz;
    const float weight = (opacity.x + opacity.y + opacity.z) * (1.0f / 3.0f);
    light[i] = (float4)(weight / met.w * met.xyz * arriving, weight);
}
