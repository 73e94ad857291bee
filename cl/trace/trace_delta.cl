// Change of the irradiance of real surfaces by the objects, relative to their irradiance E_R without objects:
// light that objects block, and light that they send instead (bounce). Rays are sampled towards the objects'
// boxes, towards the lights, which objects may block, and by the cosine.
//
// in   list, count    pixels to trace (y * width + x) and how many
//      guide          7 planes (lib/gbuffer/guide.h): world normal, position, id
//      world          lib/world/world.h
//      cache          lib/world/real/irradiance.h
// out  signal         6 planes: blocked / E_R rgb, bounce / E_R rgb
//      samples        1 plane: number of the pixel's rays since the start, in and out
#define DELTA
#include "world/boxes.h"
#include "world/real/irradiance.h"
#include "world/path.h"
#include "trace/traced.h"

// Shares of rays aimed at boxes, from outside and from inside of one. Half of the rest is aimed at lights, if
// there are any; the others follow the cosine, which covers close objects. With emitting objects, these are shares of
// the rays that are not aimed at emitting triangles.
#define BOX_SHARE 0.5f
#define BOX_SHARE_INSIDE 0.2f

// Largest distance of neighbouring pixels of one surface, relative to theirs from the camera, and largest sine
// between surface and the way to them.
#define SAME_PLANE 0.1f

static inline Scatter sample_delta(const World world, const BoxView boxes, float3 o, float2 u,
                                   float2 v)
{
    Scatter s = no_scatter(boxes.n);
    float left = 1.0f;
#ifdef LAMPS
    s.lamp_share = lamps_shine(world.objects) ? LAMP_SHARE : 0.0f;
    left -= s.lamp_share;
    if (v.x >= left) {
        s.texel = LAMP_TEXEL;
        s.wi = towards_lamp(world.objects, boxes.x, u, v.y, &s.lamp_distance);
    }
#endif
    const float box_share = !(boxes.total > 0.0f) ? 0.0f
        : left * (boxes.inside ? BOX_SHARE_INSIDE : BOX_SHARE);
    s.light_share = lights_shine(world.lights) ? 0.5f * (left - box_share) : 0.0f;
    if (v.x < box_share) {
        s.wi = sample_boxes(world.objects.bounds, world.objects.count, boxes, u,
                            v.x / box_share);
    } else if (v.x < box_share + s.light_share) {
        const float3 light = sample_light(world.lights, u);
        s.texel = texel_towards(world.real, light);
        s.wi = towards_light(world.real, light, s.texel, o);
    } else if (!is_at_lamp(s)) {
        s.wi = frame_to_world(build_frame(boxes.n), sample_cosine(u));
    }
    const float cosine = fmax(dot(boxes.n, s.wi), 0.0f);
    s.diffuse = cosine / IPRT_PI;
    s.density = fmax((left - box_share - s.light_share) * cosine / IPRT_PI, 1e-20f);
    // Rays that hit no object do not need the density, but computing it after the traversal would keep `boxes`
    // in registers meanwhile.
    if (box_share > 0.0f)
        s.density +=
            box_share * box_density(world.objects.bounds, world.objects.count, boxes, s.wi);
    return s;
}

#ifdef SUN
// Return whether the picture shows a surface of color `seen` in the sun. It decides rather than a ray, which
// may be some texels off the border of a patch: objects would cast a second shadow into the shade.
static inline int is_sunlit(const RealLayer real, float3 p, float3 n, float3 seen, float3 irradiance)
{
    const float3 light = sun_irradiance(real.sun, n);
    if (!(luminance(light) > 0.0f))
        return 0;
    const float shown = luminance(seen), others = luminance(irradiance);
    if (shows_sun(shown, others))
        return 1;
    if (shows_shade(shown, others, luminance(light)))
        return 0;
    const float3 o = real_start(real, p, n);
    return leaves_room(real, trace_real_layer(real, o, real.sun.disc.xyz, INFINITY));
}

// Return the share of the sun's light along d that objects let pass: dielectrics without refraction.
static inline ALWAYS_INLINE float3 passing_objects(const World world, float3 o, float3 d)
{
    float3 passing = (float3)(1.0f);
    ObjectHit hit;
#ifdef REFRACTS
    for (int i = 0; i < MOST_INTERFACES && any(passing > 0.0f); i++) {
        if (!trace_objects(world.objects, o, d, INFINITY, 0, &hit))
            break;
        const RayCone line = {0.0f, 0.0f};
        const Scatterer at = object_point(world.objects, hit, o, d, line);
        const Material material = load_surface_material(world.materials, at.material, at.finish);
        passing *= dielectric_share(material) * straight_share(world.materials, material, at, d, hit.t);
        o = at.beyond;
    }
#else
    if (trace_objects(world.objects, o, d, INFINITY, 1, &hit))
        passing = (float3)(0.0f);
#endif
    return passing;
}

// Return the offset on a surface from a pixel to the one `step` further in its planes; 0 where another surface
// begins.
static inline float3 offset_to(const Pixels pixels, const TracedPixel at, int step)
{
    const float3 way = load_traced(pixels.guide, at.size, 3 * at.size + at.pixel + step) - at.p;
    const float off = fabs(dot(way, at.n)), most = SAME_PLANE * length(at.p);
    return off < SAME_PLANE * length(way) && length(way) < most ? way : (float3)(0.0f);
}
#endif

TRACING_KERNEL void trace_delta(
    const Pixels pixels,
    const World world,
    const IrradianceCache cache,
    const float min_solid_angle,                 // least solid angle of objects that counts, sr
    __global uint *restrict samples,
    __global float *restrict signal,
    const Work work)
{
    LIST_ITEM(pixels.count[0]);
    COUNT_ITEM;
    Sums blocked, bounce;
    clear_sums(blocked);
    clear_sums(bounce);
    for (int ray = 0; ray < RAYS_PER_SAMPLE * pixels.rays; ray++) {
        const TracedPixel at = traced_pixel(pixels, item, 0x64656c74u);
        const float3 o = real_start(world.real, at.p, at.n);
        const float3 o_object = at.p + world.real.bias * at.n;
        const BoxView boxes =
            view_boxes(world.objects.bounds, world.objects.count, o_object, at.n);
        if (!boxes_matter(boxes, min_solid_angle))
            break;
        const uint index = READ_AGAIN(samples + at.pixel) + ray / RAYS_PER_SAMPLE;
        const float2 u = sobol_2d(index, at.seed), v = sobol_2d(index, hash_combine(at.seed, 1));
        Scatter s;
#ifdef SAMPLES_VIRTUAL_LIGHTS
        if (ray % RAYS_PER_SAMPLE) {
            float weight;
            s = at_virtual_light(world.objects.virtual_lights, o_object, at.n, (float3)(u, v.x), &weight);
            s.diffuse = weight * fmax(dot(at.n, s.wi), 0.0f) / IPRT_PI;
        } else
#endif
        s = sample_delta(world, boxes, o, u, v);
        if (!(s.diffuse > 0.0f))
            continue;
        const PathSums sums = {bounce, 0, blocked, 1.0f};
        const RayCone cone = {0.0f, lobe_spread(s.density, 0.0f)};
        trace_path(world, o, o_object, s, cone, (float3)(s.diffuse), at.seed, index, sums);
    }
    const TracedPixel at = traced_pixel(pixels, item, 0x64656c74u);
    samples[at.pixel] += pixels.rays;
    // f cos is cos / pi: the sums are irradiance / pi, as in the cache.
    float3 irradiance = cached_irradiance(cache, at.p, at.n);
#ifdef SUN
    // The cache leaves it out: it is too coarse for the borders of patches.
    const float3 o_object = at.p + world.real.bias * at.n;
    const float3 seen = load_planes(pixels.color, at.size, at.pixel);
    const int hidden
        = meets_boxes(world.objects.bounds, world.objects.count, o_object, world.real.sun.disc.xyz);
    if ((hidden || any(summed(blocked) + summed(bounce) > 0.0f))
        && is_sunlit(world.real, at.p, at.n, seen, irradiance)) {
        const float3 light = sun_irradiance(world.real.sun, at.n);
        for (int ray = 0; hidden && ray < pixels.rays; ray++) {
            const uint index = READ_AGAIN(samples + at.pixel) - ray;
            const float3 d = sample_sun(world.real.sun, sobol_2d(index, hash_combine(at.seed, 2)));
            // The sun is so small that shadows would have jagged edges.
            const float2 u = sobol_2d(index, hash_combine(at.seed, 3)) - 0.5f;
            const float3 start = o_object + u.x * offset_to(pixels, at, 1)
                + u.y * offset_to(pixels, at, plane_stride(pixels.width));
            add_to(blocked, light * (1.0f - passing_objects(world, start, d)));
        }
        irradiance += light;
    }
#endif
    const float3 scale = inverse_of_irradiance(irradiance, cache.black) / (float)pixels.rays;
    store_signal(signal, at, scale, summed(blocked), summed(bounce));
}
