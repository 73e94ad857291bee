// Irradiance of real surfaces with and without the virtual objects (IPRT Algorithm 1, lines 1-9). Both use the
// same rays (common random numbers), so that E_RV = E_R bit for bit wherever no ray hits an object.
//
// in   list, count    pixels to trace (y * width + x) and how many
//      guide          7 planes (lib/gbuffer/guide.h): world normal, position, id
//      real, objects  lib/world/world.h
// out  signal         6 planes: E_R rgb, E_RV rgb; irradiance / pi
//      touched        1 plane: TOUCHED_FRAMES where a ray hit an object
//      samples        1 plane: number of the pixel's rays since the start, in and out
#define WITHOUT_OBJECTS
#include "world/path.h"
#include "trace/traced.h"

TRACING_KERNEL void trace_real(
    const Pixels pixels,
    const World world,
    __global uint *restrict samples,
    __global float *restrict signal,
    __global float *restrict touched,
    const Work work)
{
    LIST_ITEM(pixels.count[0]);
    COUNT_ITEM;
    Sums without, with;
    clear_sums(without);
    clear_sums(with);
    int met = 0;
    const uint first = samples[pixel_of(pixels.list[item], pixels.width)];
    for (int ray = 0; ray < pixels.rays; ray++) {
        const TracedPixel at = traced_pixel(pixels, item, 0x7265616cu);
        const uint index = first + ray;
        const float3 d =
            frame_to_world(build_frame(at.n), sample_cosine(sobol_2d(index, at.seed)));
        const PathSums sums = {with, 0, without, 1.0f};
        const RayCone cone = {0.0f, lobe_spread(dot(at.n, d) / IPRT_PI, 0.0f)};
        met |= trace_path(world, real_start(world.real, at.p, at.n), at.p + world.real.bias * at.n,
                          no_scatter(d), cone, (float3)(1.0f), at.seed, index, sums).met;
    }
    const int pixel = pixel_of(READ_AGAIN(pixels.list + item), pixels.width);
    const int size = plane_size(pixels.width, pixels.height);
    samples[pixel] = first + pixels.rays;
    store_planes(signal, size, pixel, summed(without) / (float)pixels.rays);
    store_planes(signal + 3 * size, size, pixel, summed(with) / (float)pixels.rays);
    if (met)
        touched[pixel] = TOUCHED_FRAMES;
}
