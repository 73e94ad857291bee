// What objects change in the reflection that a glossy real surface shows the camera: for rays of the
// specular lobe that meet an object first, its radiance in place of that of the real surface behind.
// Exactly 0 where no ray does.
//
// in   list, count    pixels to trace (y * width + x) and how many
//      guide          7 planes (lib/gbuffer/guide.h): world normal, position, 1 + index of the real material
//      world          lib/world/world.h, with -D GLOSS
// out  change         3 planes: radiance, of either sign
//      touched        1 plane: TOUCHED_FRAMES where a ray met an object
//      samples        1 plane: rays that the pixel has sent since the start, in and out
//
// The differential radiance of T. A. Franke, "Delta Voxel Cone Tracing" (ISMAR 2014), by rays.
#define DELTA
#include "world/path.h"
#include "methods/traced.h"

TRACING_KERNEL void trace_gloss(
    TRACED_PARAMETERS,
    WORLD_PARAMETERS,
    __global uint *restrict samples,
    __global float *restrict change,
    __global float *restrict touched WORK_PARAMETER)
{
    LIST_ITEM(count[0]);
    COUNT_ITEM;
    const World world = WORLD(view);
    const TracedPixel at = TRACED_PIXEL(item, 0x676c6f73u);
    const int pixel = at.pixel, size = at.size;
    const float3 n = at.n, p = at.p;
    const int index = at.id - 1;
    const Material material = load_material(real_materials, index);
    const float3 tint = real_reflectance[index].xyz;
    const float3 o = real_start(world.real, p, n);
    const float3 o_object = p + world.real.bias * n;
    const Frame frame = build_frame(n);
    const float3 viewer = brdf_local_wo(frame, -p / length(p));
    const uint seed = at.seed;
    const BoxView boxes = view_boxes(world.objects.bounds, world.objects.objects, o_object, n);

    float3 hidden = (float3)(0.0f), shown = (float3)(0.0f);
    int met = 0;
    const uint first = samples[pixel];
    for (int ray = 0; ray < rays && boxes.above; ray++) {
        const uint number = first + ray;
        const BrdfSample sample =
            sample_specular(material, tint, frame, viewer, sobol_2d(number, seed));
        if (!(sample.weight.x + sample.weight.y + sample.weight.z > 0.0f))
            continue;
        const PathResult path =
            trace_path(world, o, o_object, no_scatter(sample.wi), boxes, seed, number);
        hidden += sample.weight * path.real;
        shown += sample.weight * path.arriving;
        met |= path.met;
    }
    samples[pixel] = first + rays;
    const float3 share = seen_share(world, material, p);
    store_planes(change, size, pixel, (shown - share * hidden) / (float)rays);
    if (met)
        touched[pixel] = TOUCHED_FRAMES;
}
