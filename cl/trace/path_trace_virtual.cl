// Reflected light of virtual surfaces, by path tracing. The diffuse lobe is stored without albedo, which
// compositing applies at full resolution.
//
// in   list, count    pixels to trace (y * width + x) and how many
//      guide          7 planes (lib/gbuffer/guide.h): world normal towards the viewer, position, id
//      surfaces       planes of the visible surfaces
//      world          lib/world/world.h
//      environment    trace/environment_samples.cl
// out  diffuse        3 planes: irradiance / pi; null if no material has a diffuse lobe
//      specular       3 planes: radiance; null if no material has a specular lobe
//      samples        1 plane: number of the pixel's paths since the start, in and out
//      touched        1 plane: TOUCHED_FRAMES where a ray hit an object
#include "trace/paths.h"
#include "trace/surfaces.h"

TRACING_KERNEL void path_trace_virtual(
    const Pixels pixels,
    const Surfaces surfaces,
    const World world,
    const Environment environment,
    __global uint *restrict samples,
    __global float *restrict diffuse,
    __global float *restrict specular,
    __global float *restrict touched,
    const Work work)
{
    LIST_ITEM(pixels.count[0]);
    COUNT_ITEM;
    const int paths = PATHS_PER_PAIR * pixels.rays;
    Sums diffuse_sum, specular_sum;
    clear_sums(diffuse_sum);
    clear_sums(specular_sum);
    int met = 0;
    for (int path = 0; path < paths; path++) {
        const TracedPixel at = traced_pixel(pixels, item, 0x76697274u);
        const float distance = length(at.p);
        PathSurface start;
        start.o = start.o_object = at.p + object_lift(world.objects, distance) * at.n;
        start.n = at.n;
        start.viewer = -at.p / distance;
        start.albedo = load_traced(surfaces.albedo, at.size, at.pixel);
        start.material = seen_material(surfaces, at);
        start.finish = seen_finish(surfaces, at.size, at.pixel);
        start.cone.spread = pixels.pixel_angle;
        start.cone.width = start.cone.spread * distance;
#ifdef REFRACTS
        start.beyond = at.p - object_lift(world.objects, distance) * at.n;
        start.plane = at.n;
        start.enters = 1;
        start.media = 0;
        start.t = -1.0f;
#endif
        const PathSums sums = {diffuse_sum, specular_sum, 0};
        met |= trace_pairs(world, start, at.seed, READ_AGAIN(samples + at.pixel) + path, environment, sums);
    }
    const TracedPixel at = traced_pixel(pixels, item, 0x76697274u);
    samples[at.pixel] += paths;
    if (diffuse)
        store_planes(diffuse, at.size, at.pixel, summed(diffuse_sum) / (float)paths);
    if (specular)
        store_planes(specular, at.size, at.pixel, summed(specular_sum) / (float)paths);
    if (met)
        touched[at.pixel] = TOUCHED_FRAMES;
}
