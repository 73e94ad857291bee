// Change of the irradiance of real surfaces by the objects, relative to their irradiance E_R without objects.
// Directions are sampled by the cosine and towards lights. A direction that misses the objects' boxes changes
// nothing. Of the others, up to `cache_size` are chosen at random, traced, and weighted to represent all
// (K. Rohmer, J. Jendersie, T. Grosch, "Natural Environment Illumination", IEEE TVCG 2017, section 7, Eq. 9).
//
// The choice is by selection sampling (D. E. Knuth, The Art of Computer Programming 2, 3.4.2, Algorithm
// S): directions are drawn and tested twice, and none is stored.
//
// in   list, count    pixels to trace (y * width + x) and how many
//      guide          7 planes (lib/gbuffer/guide.h): world normal, position, id
//      world          lib/world/world.h
//      cache          lib/world/real/irradiance.h
// out  signal         6 planes: blocked / E_R rgb, bounce / E_R rgb
//      samples        1 plane: number of the pixel's directions since the start, in and out
#define DELTA
#include "trace/traced.h"
#include "world/boxes.h"
#include "world/path.h"
#include "world/real/irradiance.h"

// Streams of random numbers.
#define CACHED 0x64697463u
#define CHOICE 2u

static inline Scatter sample_direction(const World world, float3 n, uint index, uint seed)
{
    Scatter s = no_scatter(n);
    const float2 u = sobol_2d(index, seed);
    int aimed = 0;
    s.light_share = lights_shine(world.lights) ? 0.5f : 0.0f;
    aimed = sobol_1d(index, hash_combine(seed, 1)) < s.light_share;
    if (aimed)
        s.wi = sample_light(world.lights, u);
    if (!aimed)
        s.wi = frame_to_world(build_frame(n), sample_cosine(u));
    const float cosine = fmax(dot(n, s.wi), 0.0f);
    s.diffuse = cosine / IPRT_PI;
    s.density = fmax((1.0f - s.light_share) * s.diffuse, 1e-20f);
    return s;
}

static inline int meets_objects(const World world, float3 o, const Scatter s)
{
    return s.diffuse > 0.0f
        && meets_boxes(world.objects.bounds, world.objects.count, o, s.wi);
}

TRACING_KERNEL void trace_cached(
    const Pixels pixels,
    const World world,
    const IrradianceCache cache,
    const int cache_size,                  // most traced rays; 0: all are traced, without the test
    __global uint *restrict samples,
    __global float *restrict signal,
    const Work work)
{
    LIST_ITEM(pixels.count[0]);
    COUNT_ITEM;
    int hits = pixels.rays;
    if (cache_size > 0) {
        const TracedPixel at = traced_pixel(pixels, item, CACHED);
        const uint first = samples[at.pixel];
        const float3 o = at.p + world.real.bias * at.n;
        hits = 0;
        for (int i = 0; i < pixels.rays; i++)
            hits += meets_objects(world, o, sample_direction(world, at.n, first + i, at.seed));
    }
    const int traced = cache_size > 0 ? min(hits, cache_size) : pixels.rays;
    Sums blocked, bounce;
    clear_sums(blocked);
    clear_sums(bounce);
    int left = hits, next = 0;
    for (int ray = 0; ray < traced; ray++) {
        const TracedPixel at = traced_pixel(pixels, item, CACHED);
        const uint first = READ_AGAIN(samples + at.pixel);
        const float3 o_object = at.p + world.real.bias * at.n;
        Scatter s = no_scatter(at.n);
        int chosen = 0;
        for (int i = next; i < pixels.rays && !chosen; i++) {
            next = i + 1;
            s = sample_direction(world, at.n, first + i, at.seed);
            if (cache_size == 0) {
                chosen = 1;
            } else if (meets_objects(world, o_object, s)) {
                const float u = u01(hash_combine(hash_combine(at.seed, CHOICE), first + i));
                chosen = u * left < traced - ray;
                left--;
            }
        }
        if (!(s.diffuse > 0.0f))
            continue;
        const float3 o = real_start(world.real, at.p, at.n);
        const PathSums sums = {bounce, 0, blocked, 1.0f};
        const RayCone cone = {0.0f, lobe_spread(s.density, 0.0f)};
        trace_path(world, o, o_object, s, cone, (float3)(s.diffuse), at.seed, first + next - 1, sums);
    }
    const TracedPixel at = traced_pixel(pixels, item, CACHED);
    samples[at.pixel] += pixels.rays;
    // f cos is cos / pi: the sums are irradiance / pi, as in the cache of E_R.
    const float others = traced > 0 ? (float)hits / traced : 0.0f;
    const float3 scale = inverse_irradiance(cache, at.p, at.n) * (others / pixels.rays);
    store_signal(signal, at, scale, summed(blocked), summed(bounce));
}
