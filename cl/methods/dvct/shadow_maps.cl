// Shadow maps of the area lights: distances of objects and of real surfaces (T. A. Franke, "Delta Voxel Cone
// Tracing", section 3.2: maps of the scene with and without the objects).
//
// in   scene             lib/world/real/real.h
//      area_lights       area_lights.h
// out  maps              distance to the nearest object and to the nearest real surface, metres; INFINITY: none
#include "area_lights.h"
#include "world/objects/objects.h"
#include "world/real/real.h"

TRACING_KERNEL void shadow_maps(
    const RealLayer real,
    const Objects objects,
    __global const float4 *restrict area_lights,
    const int area_light_count,
    const int map_side,
    __global float2 *restrict maps,
    const Work work)
{
    const int texel = get_global_id(0), number = get_global_id(1);
    if (texel >= map_side * map_side || number >= area_light_count)
        return;
    const AreaLight light = area_light(area_lights, number);
    const float2 place = (float2)(texel % map_side, texel / map_side) + 0.5f;
    const float3 d = map_direction(light, place, map_side);
    float2 met = (float2)(INFINITY);
    if (dot(d, d) > 0.0f) {
        ObjectHit hit;
        hit.t = INFINITY;
        if (trace_objects(objects, light.position, d, INFINITY, 0, &hit))
            met.x = hit.t;
        met.y = trace_real_layer(real, light.position, d, INFINITY).t;
    }
    maps[number * map_side * map_side + texel] = met;
}
