// Reflected radiance of the objects' voxels, as diffuse surfaces: one bounce of the room's light, gathered by
// wide cones and attenuated by the objects (K. Rohmer et al., "Natural Environment Illumination", section 6.4).
//
// in   scene, objects    lib/trace/voxels.h; the opacity of objects
//      surroundings      lib/trace/prefiltered.h
//      surface, facing   trace/voxelize_objects.cl
// out  light             the finest level
#include "trace/object_voxels.h"
#include "trace/prefiltered.h"
#include "maths/sampling.h"

#define LIGHT_CONES 6

TRACING_KERNEL void light_objects(
    const Voxels scene,
    const Voxels objects,
    const Surroundings around,
    __global const float4 *restrict surface,
    __global const float4 *restrict facing,
    __global float4 *restrict light)
{
    const int4 size = objects.levels[0];
    const int i = get_global_id(0);
    if (i >= size.x * size.y * size.z)
        return;
    const ObjectVoxel voxel = object_voxel(objects, surface, facing, i);
    const float3 n = voxel.n;
    float3 arriving = (float3)(0.0f);
    for (int cone_number = 0; cone_number < (voxel.filled ? LIGHT_CONES : 0); cone_number++) {
        Cone cone;
        cone.d = frame_to_world(build_frame(n), sample_cosine(sobol_2d(cone_number, hash_u32(i))));
        cone.rise = dot(cone.d, n);
        cone.lift = CONE_CLEARANCE * objects.box.w;
        cone.o = voxel.p + cone.lift * n;
        cone.slope = cone_slope(IPRT_PI / (LIGHT_CONES * cone.rise));
        const float passed = trace_cone(objects, cone, 0.0f, 0.0f, 0).passed;
        cone.lift = CONE_FAR;
        const ConeLight real = trace_cone(scene, cone, scene.box.w, 0.0f, 1);
        arriving += passed * all_arriving(around, cone, real);
    }
    light[i] = reflected_light(voxel, arriving, LIGHT_CONES);
}
