// Change of the reflection of a glossy real surface by the objects, by one cone as wide as the specular lobe
// (T. A. Franke, "Delta Voxel Cone Tracing", Eq. 6): the objects' radiance minus the radiance that they block,
// plus the antiradiance of real surfaces.
//
// in   list, count       pixels to trace (y * width + x) and how many
//      guide             7 planes (lib/gbuffer/guide.h): world normal, position, 1 + index of the real material
//      scene, objects, delta   lib/trace/voxels.h
//      surroundings      lib/trace/prefiltered.h
//      gloss             lib/world/world.h, with -D GLOSS
// out  change            3 planes: radiance, of either sign
//      touched           1 plane: TOUCHED_FRAMES where the cone hit an object
#include "trace/prefiltered.h"
#include "trace/traced.h"
#include "maths/work_counters.h"
#include "world/real/gloss.h"

TRACING_KERNEL void cone_gloss(
    const Pixels pixels,
    const Voxels scene,
    const Voxels objects,
    const Voxels delta,
    const Surroundings around,
    const int real_width,
    const int real_height,
    const Gloss gloss,
    __global float *restrict change,
    __global float *restrict touched,
    const Work work)
{
    LIST_ITEM(pixels.count[0]);
    COUNT_ITEM;
    const TracedPixel at = traced_pixel(pixels, item, 0x676c6f73u);
    const Material material = load_material(gloss.materials, at.id - 1);
    const Frame frame = build_frame(at.n);
    float solid_angle;
    const BrdfSample lobe =
        mirrored_lobe(material, gloss.reflectance[at.id - 1].xyz, frame,
                      brdf_local_wo(frame, -at.p / length(at.p)), &solid_angle);
    Cone cone;
    cone.o = at.p;
    cone.d = lobe.wi;
    cone.rise = fmax(dot(cone.d, at.n), 1e-3f);
    cone.slope = cone_slope(solid_angle);
    cone.lift = CONE_FAR;
    const ConeLight object = trace_cone(objects, cone, 0.0f, 0.0f, 1);
    const int met = object.passed < 1.0f;
    cone.lift = 0.0f;
    const float rise = fmax(cone.rise, LEAST_RISE);
    const float front = met ? object.distance : 0.0f;
    const ConeLight less = trace_cone(delta, cone, CONE_CLEARANCE * delta.box.w / rise, front, 1);
    float3 shown = object.passed * less.radiance, hidden = (float3)(0.0f);
    if (met) {
        const ConeLight real =
            trace_cone(scene, cone, CONE_CLEARANCE * scene.box.w / rise, front, 1);
        shown += less.front * object.radiance;
        hidden = (1.0f - object.passed) * all_arriving(around, cone, real);
    }
    const float3 share = seen_share(gloss, material, (float2)((float)real_width, (float)real_height), at.p);
    store_planes(change, at.size, at.pixel, lobe.weight * (shown - share * hidden));
    if (met)
        touched[at.pixel] = TOUCHED_FRAMES;
}
