// Reflected light of virtual surfaces (IPRT Algorithm 1, lines 10-16). The diffuse lobe is stored without
// albedo, which compositing applies at full resolution.
//
// in   list, count    pixels to trace (y * width + x) and how many
//      guide          7 planes (lib/gbuffer/guide.h): world normal towards the viewer, position, id
//      surfaces       planes of the visible surfaces
//      known          temporal means of the last picture (iprt/trace/tracer_arguments.py)
//      real, objects  lib/world/world.h
// out  diffuse        3 planes: irradiance / pi; null if no material has a diffuse lobe
//      specular       3 planes: radiance; null, as is `hit`, if no material has a specular lobe
//      hit            1 plane: distance to the reflected surface, metres, the harmonic mean over
//                     the specular lobe; negative: mostly objects, FAR_HIT: the sky, 0: no specular lobe
//      touched        1 plane: TOUCHED_FRAMES where a ray hit an object
//      samples        1 plane: number of the pixel's rays since the start, in and out
#define RELIT
#include "filter/signal.h"
#include "world/path.h"
#include "trace/rays.h"
#include "trace/surfaces.h"

#define FAR_HIT 1e6f

// Standard deviation of a pixel's temporal mean for which the pixel sends `rays`, as displayed with a gamma of 2. The
// panorama's mean radiance is displayed as 1.
#define EXPECTED_NOISE 0.08f
// Radiance, relative to the panorama's mean, below which all is displayed with the same contrast.
#define DARK_RADIANCE 0.1f
// Factor of the variance of narrow reflections, which the spatial filter smooths less.
#define UNFILTERED 8.0f
// Factor of `rays` in the noisiest pixels.
#define NOISY_PIXEL_RAYS 2.0f

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

// Return the number of rays of a pixel. Where its mean fades and its history is long enough to tell the noise, it is
// in proportion to the noise of the displayed mean.
static inline float rays_by_noise(int rays, const Known known, const Material material, float albedo, int size, int pixel)
{
    const float held = known.certainty[LENGTH_PLANE * size + pixel];
    if (!(known.fading > 0.0f) || is_short(held))
        return rays * share_of_rays(held, rays);
    float variance = 0.0f, radiance = DARK_RADIANCE * known.mean_radiance;
    if (known.specular) {
        const float kept = material.alpha > AIMED_ALPHA ? 1.0f : UNFILTERED;
        variance += kept * known.specular[(REFLECTED_PLANES + SPREAD_PLANE) * size + pixel];
        radiance = fmax(radiance, known.specular[(REFLECTED_PLANES + SCALAR_PLANE) * size + pixel]);
    }
    if (known.diffuse) {
        variance += albedo * albedo * known.diffuse[(REFLECTED_PLANES + SPREAD_PLANE) * size + pixel];
        radiance = fmax(radiance, albedo * known.diffuse[(REFLECTED_PLANES + SCALAR_PLANE) * size + pixel]);
    }
    variance *= known.fading / (2.0f - known.fading);
    const float noise = 0.5f * sqrt(variance / fmax(radiance * known.mean_radiance, 1e-30f));
    return clamp(rays * noise / EXPECTED_NOISE, 1.0f, NOISY_PIXEL_RAYS * rays);
}

// Return the direction through a random position in a pixel.
static inline ALWAYS_INLINE float3 jittered(const Jitter jitter, const TracedPixel at, uint index)
{
    const float2 within = sobol_2d(index, hash_combine(at.seed, 3));
    return view_direction(jitter.view, (float2)(at.x, at.y) + within);
}

TRACING_KERNEL void trace_virtual(
    const Pixels pixels,
    const Surfaces surfaces,
    const Known known,
    const World world,
    const Jitter jitter,
    __global uint *restrict samples,
    __global float *restrict diffuse,
    __global float *restrict specular,
    __global float *restrict hit_distance,
    __global float *restrict touched,
    const Work work)
{
    LIST_ITEM(pixels.count[0]);
    COUNT_ITEM;
    Sums diffuse_sum, specular_sum;
    clear_sums(diffuse_sum);
    clear_sums(specular_sum);
    volatile float lobe = 0.0f, lobe_nearness = 0.0f, lobe_met = 0.0f;
    int met = 0;
    const int own = pixel_of(pixels.list[item], pixels.width);
    const int planes = plane_size(pixels.width, pixels.height);
    const Material seen = load_surface_material(
        world.materials, (int)pixels.guide[GUIDE_ID * planes + own] - 1, seen_finish(surfaces, planes, own));
    const float3 base = diffuse_albedo(seen, load_planes(surfaces.albedo, planes, own));
    const float steady = rays_by_noise(pixels.rays, known, seen, luminance(base), planes, own);
    const float deserved = steady * isolation(pixels.guide, planes, own, plane_stride(pixels.width),
                                              load_planes(pixels.guide, planes, own));
    // A quotient may be 2.5 ulp below the exact integer.
    const int more = max((int)(deserved + 1e-3f), 1);
#ifdef OBJECTS_BVH
    const int jitters = is_specular(seen) ? jitter.metals : jitter.others;
    // Number of the last ray that started within the pixel, from 1 on. Its start is traced again, because the hit
    // would occupy registers along each ray.
    uint last_start = 0;
#endif
    for (int ray = 0; ray < more; ray++) {
        const TracedPixel at = traced_pixel(pixels, item, 0x76697274u);
        const uint seed = at.seed, index = READ_AGAIN(samples + at.pixel) + ray;
        float3 n = at.n, viewer = -normalize(at.p), color = load_traced(surfaces.albedo, at.size, at.pixel);
        float3 o = at.p + object_lift(world.objects, length(at.p)) * n;
        Finish finish = seen_finish(surfaces, at.size, at.pixel);
        int shown = seen_material(surfaces, at); // its variant
        const RayCone pixel_cone = {0.0f, pixels.pixel_angle};
#ifdef REFRACTS
        Scatterer from = {o, n, color, shown};
        from.beyond = at.p - object_lift(world.objects, length(at.p)) * n;
        from.plane = n;
        from.enters = 1;
#endif
#ifdef OBJECTS_BVH
        // Start at a random position in the pixel if it shows the same material, else where the last ray did.
        for (int again = 0; again < 2 * jitters; again++) {
            const uint start = again ? last_start : index + 1;
            if (start == 0)
                break;
            const float3 d = jittered(jitter, at, start - 1);
            ObjectHit hit;
            if (trace_objects(world.objects, (float3)(0.0f), d, INFINITY, 0, &hit)
                && object_material(world.objects, hit) == at.id - 1) {
                const Scatterer seen = object_point(world.objects, hit, (float3)(0.0f), d, pixel_cone);
                o = seen.position;
                n = seen.normal;
                color = seen.albedo;
                finish = seen.finish;
#ifdef VARIANTS
                shown = seen.material;
#endif
                viewer = -d;
#ifdef REFRACTS
                from = seen;
#endif
                last_start = start;
                break;
            }
        }
#endif
        const float2 u = sobol_2d(index, seed);
        float2 v = sobol_2d(index, hash_combine(seed, 1));
        float3 o_object = o;
#ifdef REFRACTS
        Material material = load_surface_material(world.materials, shown, finish);
        Scatter s;
        if (is_passable(material, &v)) {
            s = scatter_glass(world, material, from, viewer, -1.0f, (float3)(u, v.x), LEAST_FIRST, 0, &o, &o_object);
        } else {
            const float factor = become_opaque(&material);
            s = scatter(world, material, color, o, n, viewer, (float4)(u, v));
            s.diffuse *= factor;
        }
#else
        const Material material = load_surface_material(world.materials, shown, finish);
        const Scatter s = scatter(world, material, color, o, n, viewer, (float4)(u, v));
#endif
        if (!(s.diffuse + s.specular.x + s.specular.y + s.specular.z > 0.0f))
            continue;
        const float shine = luminance(s.specular);
        lobe += shine;
#ifdef PRINCIPLED
        const PathSums sums = {diffuse_sum, specular_sum, 0, s.diffuse, s.specular};
        const float3 color_of_metal = (float3)(1.0f);
#else
        // Metal has no other lobe than a colored one, and the lobe of plastic has no color.
        const PathSums sums = {diffuse_sum, specular_sum, 0, s.diffuse, shine};
        const float3 color_of_metal = is_specular(material) ? s.specular / shine : (float3)(1.0f);
#endif
        const RayCone cone = scattered_cone(pixel_cone, length(o), s.density, material.alpha);
        const FirstHit hit = trace_path(world, o, o_object, s, cone, color_of_metal, seed, index, sums);
        met |= hit.met;
        lobe_nearness += shine / clamp(hit.distance, 1e-6f, FAR_HIT);
        lobe_met += hit.met ? shine : 0.0f;
    }
    const int size = plane_size(pixels.width, pixels.height);
    const int listed = READ_AGAIN(pixels.list + item), pixel = pixel_of(listed, pixels.width);
    samples[pixel] += more;
    // f / albedo is at most 1 / pi: without albedo, the signal is a mean of radiance.
    if (diffuse)
        store_planes(diffuse, size, pixel, summed(diffuse_sum) / (float)more);
    if (specular) {
        store_planes(specular, size, pixel, summed(specular_sum) / (float)more);
        const float distance = fmin(lobe / lobe_nearness, FAR_HIT);
        hit_distance[pixel] = lobe > 0.0f ? copysign(distance, 0.5f * lobe - lobe_met) : 0.0f;
    }
    if (met)
        touched[pixel] = TOUCHED_FRAMES;
}
