// Paths through the mixed scene. Virtual surfaces scatter a path; a real surface ends it with the radiance
// of the panorama.
//
// A path meets up to `max_bounces` virtual surfaces. The ray after the last one sees real surfaces only
// (Algorithm 1, lines 4-6).
// -D GLOSS lets one glossy real surface per path reflect as well. The radiance of glossy surfaces is then
// their diffuse part only (iprt/world/real/highlight.py).
// -D EMISSION: some virtual surfaces emit light. A share of the rays is aimed at them, where they are triangles.
// -D VIRTUAL_LIGHTS: lights without geometry, at which a share of the rays is aimed.
// -D GLASS: rays pass through dielectrics, without counting these as bounces. Rays at the sun and at lights without
// geometry pass straight through: refracted ones would meet the sun by chance, as bright specks, and no other light.
// -D DISTANT_ENVIRONMENT treats the panorama as infinitely far: environment mapping.
#pragma once

#include "world/boxes.h"
#include "world/emission.h"
#include "world/glass.h"
#include "world/scattering.h"
#include "world/real/gloss.h"
#include "maths/sampling.h"
#include "trace/sums.h"
#include "world/world.h"

// Least reflectance of a surface that counts as sunlit where a path ends.
#define SUNLIT_ALBEDO 0.2f

// Where the radiance / density of paths is summed.
typedef struct {
    volatile float *arriving;    // objects included, times `of_arriving`
    volatile float *specular;    // the same, times `of_specular`; null: nowhere
    volatile float *real;        // without objects
    float of_arriving;
#ifdef PRINCIPLED
    float3 of_specular;
#else
    float of_specular;
#endif
} PathSums;

// The first hit of a path.
typedef struct {
    float distance;     // metres; INFINITY: sky, and where an object blocks an aimed ray whose lobe is diffuse
    int met;            // it is an object; with -D DELTA, or a light without geometry
} FirstHit;

static inline ALWAYS_INLINE void arrive(const PathSums sums, float3 radiance)
{
    add_to(sums.arriving, sums.of_arriving * radiance);
    if (sums.specular)
        add_to(sums.specular, sums.of_specular * radiance);
}

#ifdef GLOSS
// Return 1 + the material index of a glossy real surface that a ray has hit, else 0.
static inline int gloss_at(const World world, const RealHit hit)
{
    int seen = hit.kind == HIT_SURFACE
        && !((int)world.real.surface[hit.texel].w & SURFACE_OPENING);
    return seen && !hit.behind ? world.gloss.map[hit.texel] : 0;
}

// Return seen_share() of gloss.h for the panorama.
static inline ALWAYS_INLINE float3 seen_highlight(
    const World world, const Material material, float3 p)
{
    return seen_share(world.gloss, material, world.real.grid.size, p);
}

// Sample the direction in which a glossy real surface at p with normal n reflects a ray along d.
static inline BrdfSample reflect_real(const World world, int index, float3 p, float3 n, float3 d,
                                      float2 u)
{
    const Material material = load_material(world.gloss.materials, index);
    const Frame frame = build_frame(n);
    BrdfSample sample = sample_specular(material, world.gloss.reflectance[index].xyz, frame,
                                        brdf_local_wo(frame, -d), u);
    sample.weight *= seen_highlight(world, material, p);
    return sample;
}
#endif

// Return the radiance of a hit of a ray in direction d, changed by objects; `sunless`: without the sun.
static inline ALWAYS_INLINE float3 real_radiance(const World world, const RealHit hit, float3 d, int sunless)
{
    const float3 captured = sunless ? pictured_radiance(world.real, hit, d) : captured_radiance(world.real, hit, d);
    return captured * relit_factor(world, hit);
}

#ifdef SUN
// Aim a ray from a hit at the sun, if objects may hide it there. Where they do, `s.specular` is the factor of its
// radiance `seen`, which is the rest of the light. The panorama's mean radiance replaces E_R / pi, for which GPUs
// would need half as many registers again.
static inline int aim_from_shade(const World world, const RealHit hit, float3 seen, float3 *o_object, Scatter *s)
{
    const float4 surface = world.real.surface[hit.texel];
    if (hit.kind > HIT_BACK_FACE || hit.behind || (int)surface.w & SURFACE_OPENING)
        return 0;
    const float3 n = -normalize(surface.xyz), p = hit_point(hit), light = sun_irradiance(world.real.sun, n);
    const float3 o = p + world.real.bias * n, towards = world.real.sun.disc.xyz;
    if (!(luminance(light) > 0.0f) || !meets_boxes(world.objects.bounds, world.objects.count, o, towards))
        return 0;
    const float3 others = (float3)(world.mean_radiance);
    if (luminance(seen) < SUNLIT_ALBEDO * luminance(others + light))
        return 0;
    // The change by objects that the view shows counts already.
    const float3 relit = fmax(relit_factor(world, hit), 1e-6f);
    *o_object = o;
    *s = no_scatter(towards);
    s->specular = fmin(others / (others + light) / relit, 1.0f);
    s->texel = SHADE_TEXEL;
    return 1;
}
#endif

#ifdef DELTA
#define FIRST_ANY 0
#else
#define FIRST_ANY 1
#endif

// Return whether a ray is aimed at a light that it sees through dielectrics without refraction.
static inline int goes_straight(const Scatter s)
{
#ifdef REFRACTS
    return is_at_sun(s) || is_at_virtual_light(s);
#else
    return 0;
#endif
}

#if defined(ADDED_LIGHT) && defined(RELIT)
#define PASSES_ON 1
#else
#define PASSES_ON 0
#endif

// Trace a path and add `throughput` times its radiance to sums. Rays start at o_object towards objects, at o
// towards real surfaces. It is one loop with one call of each march, because OpenCL compilers inline them.
// -D WITHOUT_OBJECTS also fills `real`, at the cost of tracing past the objects.
// -D DELTA computes only the change by objects: a path whose first surface is real ends there, and `real` is
// the radiance that the first object hides. With -D ADDED_LIGHT and -D RELIT, its change in the last picture arrives, so
// that real surfaces pass the light of lamps on to each other.
static inline ALWAYS_INLINE FirstHit trace_path(
    const World world, float3 o, float3 o_object, Scatter s, RayCone cone, float3 throughput, uint seed,
    uint index, PathSums sums)
{
    FirstHit first = {INFINITY, 0};
#if defined(DELTA) && defined(IMPOSTOR)
    // An occluder between a real surface and the middle of the objects blocks the surface's rays towards
    // them. The cube map does not show the occluder from behind.
    if (impostor_hides(world.real.impostor, o - world.real.impostor.centre.xyz))
        return first;
#endif
#ifdef GLOSS
    int reflected = 0;
#endif
    int bounces = world.max_bounces;
    // One more for a glossy real surface, and one for the last ray, which sees real surfaces only.
    int rays = bounces + 2;
#ifdef SUN
    rays++;
#endif
    int sunless = 0;
#ifdef REFRACTS
    int interfaces = 0, past_rough = !FIRST_ANY || s.density > 0.0f, from_real = !FIRST_ANY;
    ulong media = s.media;
#endif
    for (int bounce = 0; bounce < rays; bounce++) {
        const float3 d = s.wi;
        ObjectHit hit;
        hit.t = INFINITY;
        // Nothing depends on which object is between a virtual surface and a light that the ray is aimed at,
        // but for the distance of a reflection.
        const int diffuse = !(s.specular.x + s.specular.y + s.specular.z > 0.0f);
        int blocked_by_any = is_aimed(s) && (bounce > 0 || (FIRST_ANY && diffuse));
        const int at_light = is_at_virtual_light(s);
        blocked_by_any = (blocked_by_any || at_light) && !goes_straight(s);
        float away = INFINITY;
#ifdef SAMPLES_VIRTUAL_LIGHTS
        if (at_light)
            away = s.light_away;
        else
#endif
        if (blocked_by_any)
            away = light_distance(world.real, s.texel, o, d);
        int sees_objects = bounce < bounces;
#ifdef ADDED_LIGHT
        sees_objects |= is_at_lamp(s) || at_light; // light on the last object
#endif
#ifdef SUN
        sees_objects |= s.texel >= SHADE_TEXEL; // it would shine through the last object
#endif
        const int object
            = sees_objects && trace_objects(world.objects, o_object, d, away, blocked_by_any, &hit);
#ifdef SUN
        if (s.texel == SHADE_TEXEL) {
            arrive(sums, object ? throughput * s.specular : throughput);
            return first;
        }
#endif
        if (blocked_by_any && object)
            return first;
#ifdef DELTA
        if (bounce == 0 && !object && !at_light && (!PASSES_ON || is_at_lamp(s)))
            return first;
#endif
#if defined(WITHOUT_OBJECTS) || defined(DELTA)
        float t_max = object && bounce > 0 ? hit.t : INFINITY;
#else
        float t_max = object ? hit.t : INFINITY;
#endif
#ifdef SAMPLES_VIRTUAL_LIGHTS
        if (at_light)
            t_max = fmin(t_max, s.light_away - world.real.bias);
#endif
        const RealHit real = trace_real_layer(world.real, o, d, t_max);
        // The face that an object stands on and the surface below it coincide: the object's counts as hit,
        // because light would leak into the object otherwise.
        const int at_object = object && !(real.t < hit.t - world.real.bias);
#ifdef EMISSION
        if (is_at_lamp(s) && !at_object)
            return first;
#endif
        if (bounce == 0)
            first.distance = at_object ? hit.t : real.t;
#ifdef SAMPLES_VIRTUAL_LIGHTS
        if (at_light && !at_object) {
            if (isinf(s.light_away) ? leaves_room(world.real, real) : !(real.t < s.light_away - world.real.bias)) {
#ifdef DELTA
                first.met = 1;
#endif
                arrive(sums, throughput * light_intensity(world.objects.virtual_lights, s.texel - LIGHT_TEXEL));
            }
            return first;
        }
#endif
#ifdef WITHOUT_OBJECTS
        if (bounce == 0) {
            const float3 radiance = real_radiance(world, real, d, 0);
            add_to(sums.real, radiance);
            // Bit-identical where no object is hit.
            if (!at_object) {
                add_to(sums.arriving, radiance);
                return first;
            }
        }
#endif
        if (!at_object) {
#ifdef DELTA
            if (bounce == 0 && !PASSES_ON)
                return first;
#endif
            const float share = inverse_density(world, s, real);
            if (!(share > 0.0f))
                return first;
            throughput *= share;
#ifdef REFRACTS
            throughput *= left_through_surface(world.materials, media, real.t);
#endif
#ifdef DELTA
            if (bounce == 0) {
                const float3 change = pictured_radiance(world.real, real, d) * (relit_factor(world, real) - 1.0f);
#ifdef GLOSS
                // A highlight contains the share of it that hidden light has.
                add_to(sums.real, -throughput * change);
#else
                arrive(sums, throughput * change);
#endif
                return first;
            }
#endif
#ifdef GLOSS
            const int gloss = reflected ? 0 : gloss_at(world, real);
            if (gloss) {
                // A conductor has no diffuse part.
                if (load_material(world.gloss.materials, gloss - 1).kind != KIND_CONDUCTOR) {
                    const float3 radiance = real_radiance(world, real, d, sunless);
#ifdef SUN
                    // Two rays go on from here, of which one is chosen.
                    if (aim_from_shade(world, real, captured_radiance(world.real, real, d), &o_object, &s)) {
                        throughput *= 2.0f;
                        if (sobol_1d(index, hash_combine(seed, 0x73686164u)) < 0.5f) {
                            throughput *= radiance;
                            continue;
                        }
                    } else
#endif
                    arrive(sums, throughput * radiance);
                }
                const float3 n = -normalize(world.real.surface[real.texel].xyz), p = hit_point(real);
                const BrdfSample specular =
                    reflect_real(world, gloss - 1, p, n, d,
                                 sobol_2d(index, hash_combine(seed, 2 * bounce + 3)));
                throughput *= specular.weight;
                if (!(throughput.x + throughput.y + throughput.z > 0.0f))
                    return first;
                o = real_start(world.real, p, n);
                o_object = p + world.real.bias * n;
                const float alpha = load_material(world.gloss.materials, gloss - 1).alpha;
                cone = scattered_cone(cone, real.t, 0.0f, alpha);
                s = no_scatter(specular.wi);
                sunless = alpha > AIMED_ALPHA; // a ray that meets the sun by chance would be a bright speck
#ifdef REFRACTS
                media = 0;
                from_real = 1;
#endif
                reflected = 1;
                continue;
            }
#endif
            const float3 radiance = real_radiance(world, real, d, sunless);
#ifdef SUN
            if (aim_from_shade(world, real, captured_radiance(world.real, real, d), &o_object, &s)) {
                throughput *= radiance;
                continue;
            }
#endif
            arrive(sums, throughput * radiance);
            return first;
        }
        float own = 1.0f;
#ifdef DELTA
        if (bounce == 0) {
            own = inverse_density(world, s, real);
            if (!(own > 0.0f))
                return first;
            throughput *= own;
            // Where objects hide the sun is left to the caller.
            if (!is_at_lamp(s) && !at_light)
                add_to(sums.real, throughput * pictured_radiance(world.real, real, d));
        } else
#endif
        {
            if (is_aimed(s) && !goes_straight(s))
                return first;
            own = s.density > 0.0f && !is_aimed(s) ? 1.0f / s.density : 1.0f;
            throughput *= own;
        }
        first.met |= bounce == 0;
        const Scatterer at = object_point(world.objects, hit, o_object, d, cone);
#ifdef EMISSION
        const float3 emission = emitted(world, at);
        if (any(emission > 0.0f) && !is_at_sun(s) && !at_light) {
            const int alone = bounce >= bounces;
            arrive(sums, emission_weight(world, s, at, hit, o_object, own, alone) * throughput * emission);
        }
        if (is_at_lamp(s))
            return first;
#endif
        const uint stream = hash_combine(seed, 2 * bounce + 2);
        const float2 u = sobol_2d(index, stream);
        float2 v = sobol_2d(index, hash_combine(stream, 1));
        // The branches meet before the loop goes on: compilers would copy all of it for each.
#ifdef REFRACTS
        Material material = load_surface_material(world.materials, at.material, at.finish);
        throughput *= medium_transmittance(world.materials, filling(world.materials, media), hit.t);
        float3 weight;
        if (is_passable(material, &v)) {
            const int free = interfaces++ < MOST_INTERFACES;
            bounces += free;
            rays += free;
            sunless = past_rough && !is_at_sun(s);
            if (goes_straight(s)) {
#ifdef SAMPLES_VIRTUAL_LIGHTS
                s.light_away -= hit.t;
#endif
                weight = straight_share(world.materials, material, at, d, hit.t);
                o_object = at.beyond;
                o = at.beyond + world.real.bias * at.plane;
            } else {
                s = scatter_glass(world, material, at, -d, from_real ? hit.t : -1.0f, (float3)(u, v.x), LEAST_LATER,
                                  media, &o, &o_object);
                media = s.media;
                weight = s.specular;
            }
        } else {
            if (goes_straight(s))
                return first;
            sunless = 0;
            become_opaque(&material);
            o = o_object = at.position;
            s = scatter(world, material, at.albedo, o, at.normal, -d, (float4)(u, v));
            past_rough |= s.density > 0.0f;
            weight = diffuse_albedo(material, at.albedo) * s.diffuse + s.specular;
        }
        from_real = 0;
        throughput *= weight;
#else
        const Material material = load_surface_material(world.materials, at.material, at.finish);
        o = o_object = at.position;
        s = scatter(world, material, at.albedo, o, at.normal, -d, (float4)(u, v));
        throughput *= diffuse_albedo(material, at.albedo) * s.diffuse + s.specular;
#endif
        cone = scattered_cone(cone, hit.t, s.density, material.alpha);
        if (!(throughput.x + throughput.y + throughput.z > 0.0f))
            return first;
    }
    return first;
}
