// Reflected light of virtual surfaces (IPRT Algorithm 1, lines 10-16). The diffuse lobe is stored without
// albedo, which compositing applies at full resolution.
//
// in   list, count    pixels to trace (y * width + x) and how many
//      guide          7 planes (lib/gbuffer/guide.h): world normal towards the viewer, position, id
//      albedo         3 planes
//      history        1 plane: effective length of the pixel's temporal mean in the last picture, frames
//      real, objects  lib/world/world.h
// out  diffuse        3 planes: irradiance / pi; null if no material has a diffuse lobe
//      specular       3 planes: radiance; null, as is `hit`, if no material has a specular lobe
//      hit            1 plane: distance to the reflected surface, metres, the harmonic mean over
//                     the specular lobe; FAR_HIT: the sky, 0: no specular lobe
//      touched        1 plane: TOUCHED_FRAMES where a ray hit an object
//      samples        1 plane: number of the pixel's rays since the start, in and out
#define RELIT
#include "world/path.h"
#include "trace/rays.h"
#include "trace/traced.h"

#define FAR_HIT 1e6f

// Least cosine between the normals of neighbours that share samples by way of the filter.
#define ALIKE 0.95f
// Factor of the number of rays of a pixel without such neighbours.
#define ISOLATED_PIXEL_RAYS 4.0f

// Return the factor of a pixel's number of rays: 1 with eight similar neighbours, more with fewer.
static inline float isolation(__global const float *restrict guide, int size, int pixel, int stride,
                               float3 n)
{
    int alike = 1;
    for (int i = 0; i < 9; i++) {
        const int q = pixel + i % 3 - 1 + (i / 3 - 1) * stride;
        alike += i != 4 && guide[6 * size + q] == guide[6 * size + pixel]
            && dot(load_planes(guide, size, q), n) > ALIKE;
    }
    return fmin(9.0f / alike, ISOLATED_PIXEL_RAYS);
}

TRACING_KERNEL void trace_virtual(
    const Pixels pixels,
    __global const float *restrict albedo,
    __global const float *restrict history,
    const World world,
    const Jitter jitter,
    __global uint *restrict samples,
    __global float *restrict diffuse,
    __global float *restrict specular,
    __global float *restrict hit_distance,
    const int seam,
    __global float *restrict touched,
    const Work work)
{
    LIST_ITEM(pixels.count[0]);
    COUNT_ITEM;
    float3 diffuse_sum = (float3)(0.0f), specular_sum = (float3)(0.0f);
    float lobe = 0.0f, lobe_nearness = 0.0f;
    int met = 0;
    const int own = pixel_of(pixels.list[item], pixels.width);
    const int planes = plane_size(pixels.width, pixels.height);
    const uint first = samples[own];
    const float steady = pixels.rays * share_of_rays(history[own], pixels.rays);
    const float deserved = steady * isolation(pixels.guide, planes, own, plane_stride(pixels.width),
                                              load_planes(pixels.guide, planes, own));
    // A quotient may be 2.5 ulp below the exact integer.
    const int more = max((int)(deserved + 1e-3f), 1);
    float3 n, o, viewer, color;
    for (int ray = 0; ray < more; ray++) {
        const TracedPixel at = traced_pixel(pixels, item, 0x76697274u);
        const Material material = load_material(world.materials, at.id - 1);
        if (ray == 0) {
            const float distance = length(at.p);
            n = at.n;
            o = at.p + object_lift(world.objects, distance) * n;
            viewer = -at.p / distance;
            color = load_planes(albedo, planes, at.pixel);
        }
        const uint seed = at.seed, index = first + ray;
        const float2 u = sobol_2d(index, seed), v = sobol_2d(index, hash_combine(seed, 1));
#ifdef OBJECTS_BVH
        // Start at a random position in the pixel if it shows the same material, else where the last ray did.
        const float2 within = sobol_2d(index, hash_combine(seed, 3));
        float3 d = n;
        // The condition on `id` always holds: it keeps the compiler from hoisting these reads out of the loop.
        if (jitter.on && at.id > 0)
            d = view_direction(jitter.view, (float2)(at.x, at.y) + within);
        ObjectHit hit;
        if (jitter.on && trace_objects(world.objects, (float3)(0.0f), d, INFINITY, &hit)) {
            const Scatterer seen = object_point(world.objects, hit, (float3)(0.0f), d);
            if (seen.material == at.id - 1) {
                o = seen.position;
                n = seen.normal;
                viewer = -d;
                color = seen.albedo;
            }
        }
#endif
        const Scatter s = scatter(world, material, color, o, n, viewer, (float4)(u, v));
        if (!(s.diffuse + s.specular.x + s.specular.y + s.specular.z > 0.0f))
            continue;
        const PathResult path = trace_path(world, o, o, s, seed, index);
        const float away = fmin(path.distance, FAR_HIT);
        met |= path.met;
        diffuse_sum += s.diffuse * path.arriving;
        specular_sum += s.specular * path.arriving;
        lobe += luminance(s.specular);
        lobe_nearness += luminance(s.specular) / fmax(away, 1e-6f);
    }
    const int listed = READ_AGAIN(pixels.list + item), pixel = pixel_of(listed, pixels.width);
    samples[pixel] = first + more;
    // f / albedo is at most 1 / pi: without albedo, the signal is a mean of radiance.
    if (diffuse)
        store_planes(diffuse, planes, pixel, diffuse_sum / (float)more);
    if (specular) {
        store_planes(specular, planes, pixel, specular_sum / (float)more);
        store_wrapped(hit_distance, pixel, listed % pixels.width, pixels.width, seam,
                      lobe > 0.0f ? fmin(lobe / lobe_nearness, FAR_HIT) : 0.0f);
    }
    if (met)
        touched[pixel] = TOUCHED_FRAMES;
}
