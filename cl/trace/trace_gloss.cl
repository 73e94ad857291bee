// Change of the reflection of a glossy real surface by the objects: for rays of the specular lobe that hit an
// object first, its radiance minus the radiance of the real surface behind it. Exactly 0 where no ray does.
//
// in   list, count    pixels to trace (y * width + x) and how many
//      guide          7 planes (lib/gbuffer/guide.h): world normal, position, 1 + index of the real material
//      world          lib/world/world.h, with -D GLOSS
// out  change         3 planes: radiance, of either sign
//      touched        1 plane: TOUCHED_FRAMES where a ray hit an object
//      samples        1 plane: number of the pixel's rays since the start, in and out
//
// This is the differential radiance of T. A. Franke, "Delta Voxel Cone Tracing" (ISMAR 2014), by rays.
#define DELTA
#define RELIT
#include "world/boxes.h"
#include "world/path.h"
#include "trace/traced.h"

TRACING_KERNEL void trace_gloss(
    const Pixels pixels,
    const World world,
    __global uint *restrict samples,
    __global float *restrict change,
    __global float *restrict touched,
    const Work work)
{
    LIST_ITEM(pixels.count[0]);
    COUNT_ITEM;
    Sums hidden, shown;
    clear_sums(hidden);
    clear_sums(shown);
    int met = 0;
    for (int ray = 0; ray < RAYS_PER_SAMPLE * pixels.rays; ray++) {
        const TracedPixel at = traced_pixel(pixels, item, 0x676c6f73u);
        const float3 o_object = at.p + world.real.bias * at.n;
        if (!PASSES_ON && !view_boxes(world.objects.bounds, world.objects.count, o_object, at.n).above)
            break;
        const uint number = READ_AGAIN(samples + at.pixel) + ray / RAYS_PER_SAMPLE;
        const Material material = load_material(world.gloss.materials, at.id - 1);
        const float3 reflectance = world.gloss.reflectance[at.id - 1].xyz, viewer = -at.p / length(at.p);
        const float2 u = sobol_2d(number, at.seed);
        const RayCone pixel_cone = {0.0f, pixels.pixel_angle};
        const RayCone cone = scattered_cone(pixel_cone, length(at.p), 0.0f, material.alpha);
        Scatter s;
        float3 throughput;
#ifdef SAMPLES_VIRTUAL_LIGHTS
        if (ray % RAYS_PER_SAMPLE) {
            const float which = sobol_1d(number, hash_combine(at.seed, 1));
            float weight;
            s = at_virtual_light(world.objects.virtual_lights, o_object, at.n, (float3)(u, which), &weight);
            throughput = weight * fmax(dot(at.n, s.wi), 0.0f)
                * brdf_eval(material, reflectance, at.n, viewer, s.wi).specular;
        } else
#endif
        {
            const Frame frame = build_frame(at.n);
            const BrdfSample sample = sample_specular(material, reflectance, frame, brdf_local_wo(frame, viewer), u);
            s = no_scatter(sample.wi);
            throughput = sample.weight;
        }
        if (!(throughput.x + throughput.y + throughput.z > 0.0f))
            continue;
        const PathSums sums = {shown, 0, hidden, 1.0f};
        met |= trace_path(world, real_start(world.real, at.p, at.n), o_object, s, cone, throughput, at.seed,
                          number, sums).met;
    }
    const TracedPixel at = traced_pixel(pixels, item, 0x676c6f73u);
    samples[at.pixel] += pixels.rays;
    const float3 share = seen_highlight(world, load_material(world.gloss.materials, at.id - 1), at.p);
    store_planes(change, at.size, at.pixel, (summed(shown) - share * summed(hidden)) / (float)pixels.rays);
    if (met)
        touched[at.pixel] = TOUCHED_FRAMES;
}
