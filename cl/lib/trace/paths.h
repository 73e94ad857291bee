// Path tracing with next event estimation: at each surface one ray aimed at the environment and one
// sampled by the BRDF, combined by the balance heuristic (Y. Xu et al., "Delta Path Tracing for
// Real-Time Global Illumination in Mixed Reality", Algorithm 1).
//
// Rays that hit no object reach the environment: the real surfaces of the panorama or, with
// -D DISTANT_ENVIRONMENT, the panorama at infinity, with the supporting plane in front of it.
//
// -D MAX_BOUNCES: most surfaces of a path, the first included; 1 is direct light.
// -D LIGHT_SAMPLING: aim rays at the environment. Without it, all rays are sampled by the BRDF.
// -D LEARNED_RADIANCE: real surfaces have their learned radiance (lib/world/real/learned.h), or the
// panorama's where none was learned.
// -D EMISSION: some virtual surfaces emit light, which paths find by chance.
// -D GLASS: paths go on through dielectrics, which do not count as surfaces and are not aimed from.
#pragma once

#include "maths/sampling.h"
#include "trace/sums.h"
#include "world/brdf.h"
#include "world/direction.h"
#include "world/emission.h"
#include "world/glass.h"
#include "world/real/learned.h"
#include <iprt.trace.paths>

// A pixel sends `rays` pairs of rays: a pair is one path with two rays per surface, or two paths with one.
#ifdef LIGHT_SAMPLING
#define RAYS_PER_BOUNCE 2
#define PATHS_PER_PAIR 1
#else
#define RAYS_PER_BOUNCE 1
#define PATHS_PER_PAIR 2
#endif

// Receivers on the plane: largest distance from it, relative to the distance from the capture centre, and
// least cosine between the normals.
#define PLANE_DISTANCE 0.02f
#define PLANE_NORMAL 0.9f

static inline int on_plane(float4 plane, float3 p, float3 n)
{
    return fabs(dot(plane.xyz, p) - plane.w) < PLANE_DISTANCE * length(p)
        && dot(plane.xyz, n) > PLANE_NORMAL;
}

// Vertex of a path.
typedef struct {
    float3 o;            // origin of rays against real surfaces
    float3 o_object;     // origin of rays against objects
    float3 n;
    float3 viewer;
    float3 albedo;
    Finish finish;       // as in Scatterer
    int material;        // index among all instances' materials; -1: a real surface, diffuse, of albedo 1
    RayCone cone;        // of the ray that has met it, there; before its lobe widens it
#ifdef REFRACTS
    float3 beyond, plane;   // as in Scatterer
    int enters;
    ulong media;         // on the viewer's side
    float t;             // metres from the last surface if that is real, else negative
#endif
} PathSurface;

// Sums, over paths, of the incident radiance at their first surface, times f cos over the density.
typedef struct {
    volatile float *diffuse;    // without the albedo
    volatile float *specular;   // null: not summed
    volatile float *blocked;    // at real surfaces: light of the environment that objects occlude
} PathSums;

// Return f cos of a direction and the density with which the BRDF samples it.
static inline Scatter scatter_along(const World world, const PathSurface at, float3 wi)
{
    Scatter s = no_scatter(wi);
    if (at.material < 0) {
        s.diffuse = fmax(dot(at.n, wi), 0.0f) / IPRT_PI;
        s.density = fmax(s.diffuse, 1e-20f);
        return s;
    }
    Material material = load_surface_material(world.materials, at.material, at.finish);
    float opaque = 1.0f, factor = 1.0f;
#ifdef REFRACTS
    opaque -= dielectric_share(material);
    factor = become_opaque(&material);
    s.media = at.media;
#endif
    const float cosine = brdf_cosine(at.n, wi);
    const BrdfValue value = brdf_eval(material, at.albedo, at.n, at.viewer, wi);
    const float2 density = brdf_pdf(material, at.albedo, at.n, at.viewer, wi);
    s.diffuse = opaque * factor * value.diffuse * cosine;
    s.specular = opaque * value.specular * cosine;
    s.density = fmax(opaque * (density.x + density.y), 1e-20f);
    return s;
}

// Return a direction sampled by the BRDF; u in [0, 1)^3. `density` is 0 for a perfect mirror.
static inline Scatter scatter_sampled(const World world, const PathSurface at, float3 u)
{
    if (at.material < 0)
        return scatter_along(world, at, frame_to_world(build_frame(at.n), sample_cosine(u.xy)));
    Material material = load_surface_material(world.materials, at.material, at.finish);
#ifdef REFRACTS
    become_opaque(&material);
#endif
    const BrdfSample sample = brdf_sample(material, at.albedo, at.n, at.viewer, u);
    if (is_mirrored(material, sample)) {
        Scatter s = no_scatter(sample.wi);
        s.specular = sample.weight;
#ifdef REFRACTS
        s.media = at.media;
#endif
        return s;
    }
    return scatter_along(world, at, sample.wi);
}

// Return the alpha of a surface, for rays without a density.
static inline ALWAYS_INLINE float lobe_alpha(const World world, const PathSurface at)
{
    return at.material < 0 ? 0.0f : load_surface_material(world.materials, at.material, at.finish).alpha;
}

#ifdef REFRACTS
// Decide by u.y whether a path goes on through a dielectric; u in [0, 1)^2 is then as random as before.
static inline int passes_glass(const World world, const PathSurface at, float2 *u)
{
    return at.material >= 0
        && is_passable(load_surface_material(world.materials, at.material, at.finish), u);
}

// Send a path on through a dielectric; u in [0, 1)^3.
static inline Scatter scatter_through(const World world, PathSurface *at, float3 u)
{
    Scatterer point;
    point.position = at->o_object;
    point.normal = at->n;
    point.albedo = at->albedo;
    point.material = at->material;
    point.beyond = at->beyond;
    point.plane = at->plane;
    point.enters = at->enters;
    const Material material = load_surface_material(world.materials, at->material, at->finish);
    return scatter_glass(world, material, point, at->viewer, at->t, u, LEAST_LATER, at->media, &at->o, &at->o_object);
}
#endif

#ifdef LIGHT_SAMPLING
// Return a direction at the capture centre from the precomputed samples; u in [0, 1)^2.
static inline float3 environment_direction(const Environment environment, float2 u)
{
    const float4 at = environment.samples[min((int)(u.x * environment.count), environment.count - 1)];
    const float y = mix(at.z, at.w, u.y), s = sqrt(fmax(1.0f - y * y, 0.0f));
    return (float3)(-s * at.y, y, s * at.x);
}
#endif

#ifdef LEARNED_RADIANCE
#define PATH_RADIANCE(hit, o, d) path_radiance(world, environment.learned, hit, o, d)

// Return the radiance, without objects, of the real surface that a ray from o in direction d has hit.
static inline float3 path_radiance(const World world, const Learned learned, const RealHit hit, float3 o,
                                   float3 d)
{
    const float4 plane = world.real.surface[hit.texel];
    float4 known = (float4)(0.0f);
    if (hit.kind <= HIT_BACK_FACE && !((int)plane.w & SURFACE_OPENING))
        known = learned_radiance(learned, o + hit.t * d,
                                 safe_normalize(-plane.xyz, (float3)(0.0f, 1.0f, 0.0f)));
    return known.w > 0.0f ? known.xyz : captured_radiance(world.real, hit, d);
}
#else
#define PATH_RADIANCE(hit, o, d) captured_radiance(world.real, hit, d)
#endif

// Trace one path from a surface. Returns 1 if a ray from there hits an object, else 0. It is a single loop with
// one call of each traversal, because OpenCL compilers inline these.
static inline ALWAYS_INLINE int trace_pairs(const World world, PathSurface at, uint seed, uint index,
                                            const Environment environment, const PathSums sums)
{
    int met = 0;
    // `first_*` belong to the first surface, `throughput` to the later ones. They are in memory, like the sums.
    volatile float first_diffuse = 1.0f;
    Sums first_specular;
    clear_sums(first_specular);
    float3 throughput = (float3)(1.0f);
    int rays = RAYS_PER_BOUNCE * MAX_BOUNCES;
    for (int ray = 0; ray < rays; ray++) {
        const int bounce = ray / RAYS_PER_BOUNCE;
        const int delta = bounce == 0 && at.material < 0;
        const float2 u = rotated_sobol(index, 2 * ray, seed);
        Scatter s;
#ifdef LIGHT_SAMPLING
        if (ray % 2 == 0) {
            if (!lights_shine(world.lights))
                continue;
            const float3 light = environment_direction(environment, u);
            const int texel = texel_towards(world.real, light);
            s = scatter_along(world, at, towards_light(world.real, light, texel, at.o));
            s.texel = texel;
        } else
#endif
        {
            float2 v = rotated_sobol(index, 2 * ray + 1, seed);
#ifdef REFRACTS
            if (passes_glass(world, at, &v)) {
                s = scatter_through(world, &at, (float3)(u, v.x));
                rays += ray < RAYS_PER_BOUNCE * MOST_INTERFACES ? RAYS_PER_BOUNCE : 0;
            } else
#endif
            s = scatter_sampled(world, at, (float3)(u, v.x));
        }
        const int dark = !(s.diffuse + s.specular.x + s.specular.y + s.specular.z > 0.0f);
        if (dark && is_aimed(s))
            continue;
        if (dark)
            return met;

        ObjectHit hit;
        hit.t = INFINITY;
        const float away = is_aimed(s) ? light_distance(world.real, s.texel, at.o, s.wi) : INFINITY;
        const int object = trace_objects(world.objects, at.o_object, s.wi, away, is_aimed(s), &hit);
        if (is_aimed(s) && object && !delta) {
            met |= bounce == 0;
            continue;
        }
#ifndef ONE_PASS
        // Light that reaches a real surface past the objects is in the captured picture already.
        if (delta && !object && is_aimed(s))
            continue;
        if (delta && !object)
            return met;
#endif
        RealHit real = trace_real_layer(world.real, at.o, s.wi, delta ? INFINITY : hit.t);
        int aimed_at = !is_aimed(s);
#ifdef LIGHT_SAMPLING
        const float light = light_density(world.lights, world.real, real, s.wi);
        aimed_at |= light > 0.0f && real.texel == s.texel;
#else
        const float light = 0.0f;
#endif
        const float density = s.density > 0.0f ? s.density + light : 1.0f;
#ifdef DISTANT_ENVIRONMENT
        const float towards = dot(environment.plane.xyz, s.wi);
        const float to_plane = (environment.plane.w - dot(environment.plane.xyz, at.o)) / towards;
        float inverse = 1.0f / density;
        if (towards < 0.0f && to_plane > 0.0f && !delta) {
            real.t = to_plane;
            real.direction = normalize(at.o + to_plane * s.wi);
            inverse = s.density > 0.0f ? 1.0f / s.density : 1.0f;
            aimed_at = !is_aimed(s);
        }
#else
        const float inverse = 1.0f / density;
#endif
        // Where an object's face coincides with the surface that it stands on, the object is hit.
        const int at_object = object && (is_aimed(s) || !(real.t < hit.t - world.real.bias));
        met |= bounce == 0 && at_object;
        float3 passed = (float3)(1.0f);
        if (bounce > 0) {
            const Material material = load_surface_material(world.materials, at.material, at.finish);
            passed = diffuse_albedo(material, at.albedo) * s.diffuse + s.specular;
        }
        if (aimed_at && (delta || !at_object)) {
#ifdef REFRACTS
            passed *= left_through_surface(world.materials, s.media, real.t);
#endif
            const float3 arriving =
                inverse * throughput * passed * PATH_RADIANCE(real, at.o, s.wi);
            if (delta) {
                if (at_object)
                    add_to(sums.blocked, s.diffuse * arriving);
            } else {
                add_to(sums.diffuse, (bounce == 0 ? s.diffuse : first_diffuse) * arriving);
                if (sums.specular)
                    add_to(sums.specular, (bounce == 0 ? s.specular : summed(first_specular)) * arriving);
            }
        }
        if (is_aimed(s))
            continue;
        if (!at_object)
            return met;
        const float own = s.density > 0.0f ? 1.0f / s.density : 1.0f;
        if (bounce == 0) {
            first_diffuse = own * s.diffuse;
            add_to(first_specular, own * s.specular);
        } else {
            throughput *= own * passed;
        }
#ifdef REFRACTS
        throughput *= medium_transmittance(world.materials, filling(world.materials, s.media), hit.t);
#endif
        at.cone = scattered_cone(at.cone, 0.0f, s.density, lobe_alpha(world, at));
        const Scatterer next = object_point(world.objects, hit, at.o_object, s.wi, at.cone);
        at.cone.width = cone_width(at.cone, hit.t);
#ifdef EMISSION
        const float3 emission = throughput * emitted(world, next);
        add_to(sums.diffuse, first_diffuse * emission);
        if (sums.specular)
            add_to(sums.specular, summed(first_specular) * emission);
#endif
        at.o = at.o_object = next.position;
        at.n = next.normal;
        at.viewer = -s.wi;
        at.albedo = next.albedo;
        at.finish = next.finish;
        at.material = next.material;
#ifdef REFRACTS
        at.beyond = next.beyond;
        at.plane = next.plane;
        at.enters = next.enters;
        at.media = s.media;
        at.t = delta ? hit.t : -1.0f;
#endif
    }
    return met;
}
