// Change of the irradiance of real surfaces by the objects, by path tracing, relative to their irradiance
// E_R without objects.
//
// -D ONE_PASS: every ray gives the light without and with the objects, whose difference is taken (Kan and
// Kaufmann's one-pass differential rendering). Without it, only rays that hit objects are traced on (delta
// path tracing).
// -D DISTANT_ENVIRONMENT: only the surfaces of the supporting plane are relit.
// -D LOCAL_REGION: only surfaces within the boxes of objects, enlarged by this share, are relit (W. Lee et
// al. 2022, section V).
//
// in   list, count    pixels to trace (y * width + x) and how many
//      guide          7 planes (lib/gbuffer/guide.h): world normal, position, id
//      world          lib/world/world.h
//      cache          lib/world/real/irradiance.h
//      environment    trace/environment_samples.cl
// out  signal         6 planes: blocked / E_R rgb, bounce / E_R rgb
//      samples        1 plane: number of the pixel's paths since the start, in and out
//      touched        1 plane: TOUCHED_FRAMES where a ray hit an object
#include "trace/paths.h"
#include "trace/traced.h"
#include "world/real/irradiance.h"

#ifdef LOCAL_REGION
// Return 1 if p lies in one of the enlarged boxes, given by lower and upper corners, else 0.
static inline int in_region(__global const float4 *restrict boxes, int count, float3 p)
{
    int inside = 0;
    for (int i = 0; i < count; i++) {
        const float3 low = boxes[2 * i].xyz, high = boxes[2 * i + 1].xyz;
        const float3 from_middle = fabs(p - 0.5f * (low + high));
        inside |= all(from_middle <= 0.5f * (1.0f + LOCAL_REGION) * (high - low));
    }
    return inside;
}
#endif

TRACING_KERNEL void path_trace_real(
    const Pixels pixels,
    const World world,
    const IrradianceCache cache,
    const Environment environment,
    __global uint *restrict samples,
    __global float *restrict signal,
    __global float *restrict touched,
    const Work work)
{
    LIST_ITEM(pixels.count[0]);
    COUNT_ITEM;
    const int paths = PATHS_PER_PAIR * pixels.rays;
    Sums hidden, sent;
    clear_sums(hidden);
    clear_sums(sent);
    int met = 0;
    for (int path = 0; path < paths; path++) {
        const TracedPixel at = traced_pixel(pixels, item, 0x70617468u);
#ifdef LOCAL_REGION
        if (!in_region(world.objects.bounds, world.objects.count, at.p))
            break;
#elif defined(DISTANT_ENVIRONMENT)
        if (!on_plane(environment.plane, at.p, at.n))
            break;
#endif
        PathSurface start;
        start.o = real_start(world.real, at.p, at.n);
        start.o_object = at.p + world.real.bias * at.n;
        start.n = start.viewer = at.n;
        start.albedo = (float3)(0.0f);
        start.material = -1;
        start.finish = (Finish)(0.0f);
        start.cone.width = start.cone.spread = 0.0f;
        const PathSums sums = {sent, 0, hidden};
        met |= trace_pairs(world, start, at.seed, READ_AGAIN(samples + at.pixel) + path, environment, sums);
    }
    const TracedPixel at = traced_pixel(pixels, item, 0x70617468u);
    samples[at.pixel] += paths;
    const float3 scale = inverse_irradiance(cache, at.p, at.n) / (float)paths;
    store_signal(signal, at, scale, summed(hidden), summed(sent));
    if (met)
        touched[at.pixel] = TOUCHED_FRAMES;
}
