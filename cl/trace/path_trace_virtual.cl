// Reflected light of virtual surfaces, by path tracing. The diffuse lobe is stored without albedo, which
// compositing applies at full resolution.
//
// in   list, count    pixels to trace (y * width + x) and how many
//      guide          7 planes (lib/gbuffer/guide.h): world normal towards the viewer, position, id
//      albedo         3 planes
//      world          lib/world/world.h
//      environment    trace/environment_samples.cl
// out  diffuse        3 planes: irradiance / pi; null if no material has a diffuse lobe
//      specular       3 planes: radiance; null if no material has a specular lobe
//      samples        1 plane: number of the pixel's paths since the start, in and out
//      touched        1 plane: TOUCHED_FRAMES where a ray hit an object
#include "trace/paths.h"
#include "trace/traced.h"

TRACING_KERNEL void path_trace_virtual(
    const Pixels pixels,
    __global const float *restrict albedo,
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
    const TracedPixel at = traced_pixel(pixels, item, 0x76697274u);
    const int paths = PATHS_PER_PAIR * pixels.rays;
    const uint first = samples[at.pixel];
    const float distance = length(at.p);
    PathSurface start;
    start.o = start.o_object = at.p + object_lift(world.objects, distance) * at.n;
    start.n = at.n;
    start.viewer = -at.p / distance;
    start.albedo = load_planes(albedo, at.size, at.pixel);
    start.material = at.id - 1;
    float3 diffuse_sum = (float3)(0.0f), specular_sum = (float3)(0.0f);
    int met = 0;
    for (int path = 0; path < paths; path++) {
        const PathSums sums = trace_pairs(world, start, at.seed, first + path, environment);
        diffuse_sum += sums.diffuse;
        specular_sum += sums.specular;
        met |= sums.met;
    }
    samples[at.pixel] = first + paths;
    if (diffuse)
        store_planes(diffuse, at.size, at.pixel, diffuse_sum / (float)paths);
    if (specular)
        store_planes(specular, at.size, at.pixel, specular_sum / (float)paths);
    if (met)
        touched[at.pixel] = TOUCHED_FRAMES;
}
