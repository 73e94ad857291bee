// Path tracing with next event estimation: at each surface one ray aimed at the environment and one
// sampled by the reflectance, combined by the balance heuristic (Y. Xu et al., "Delta Path Tracing for
// Real-Time Global Illumination in Mixed Reality", Algorithm 1).
//
// The environment is what the panorama shows where no object is hit: its own surfaces, or with
// -D DISTANT_ENVIRONMENT its directions, before which only a plane lies.
//
// -D MAX_BOUNCES is how many surfaces a path may meet, the first included: 1 is direct light.
// -D LIGHT_SAMPLING aims at the environment; without, all rays are sampled by the reflectance.
// -D LEARNED_RADIANCE: real surfaces send what was learned of them (lib/world/real/learned.h), and what the panorama
// shows of them where nothing was.
#ifndef IPRT_PATH_TRACING_H
#define IPRT_PATH_TRACING_H

#include "maths/sampling.h"
#include "world/brdf.h"
#include "world/direction.h"

#define PATH_PARAMETERS                                                                            \
    const int environment_count, __global const float4 *restrict environment_samples,              \
        const float4 support_plane

// What trace_pairs takes of them.
#define PATH_ARGUMENTS environment_count, environment_samples, support_plane

// How many rays a surface sends where a pixel sends `rays` pairs.
#ifdef LIGHT_SAMPLING
#define RAYS_PER_BOUNCE 2
#define PATHS_PER_PAIR 1
#else
#define RAYS_PER_BOUNCE 1
#define PATHS_PER_PAIR 2
#endif

// Receivers lie within this fraction of their distance from the plane; cosine of their normals.
#define PLANE_DISTANCE 0.02f
#define PLANE_NORMAL 0.9f

static inline int on_plane(float4 plane, float3 p, float3 n)
{
    return fabs(dot(plane.xyz, p) - plane.w) < PLANE_DISTANCE * length(p)
        && dot(plane.xyz, n) > PLANE_NORMAL;
}

// The surface that a path has reached.
typedef struct {
    float3 o;            // where rays towards real surfaces start
    float3 o_object;     // and rays towards objects
    float3 n;
    float3 viewer;
    float3 albedo;
    int material;        // of all instances; -1: a real surface, diffuse, without its albedo
} PathSurface;

// What arrives at the first surface of paths, times f cos over the densities.
typedef struct {
    float3 diffuse;      // without the albedo
    float3 specular;
#ifdef ONE_PASS
    float3 unoccluded;   // real surfaces: all of the environment
    float3 passing;      // and what passes the objects
#else
    float3 blocked;      // real surfaces: what objects hide of the environment
#endif
    int met;             // a ray from the first surface meets an object
} PathSums;

// f cos of a direction and the density with which the reflectance samples it.
static inline Scatter scatter_along(const World world, const PathSurface at, float3 wi)
{
    Scatter s = no_scatter(wi);
    const float cosine = fmax(dot(at.n, wi), 0.0f);
    if (at.material < 0) {
        s.diffuse = cosine / IPRT_PI;
        s.density = fmax(s.diffuse, 1e-20f);
        return s;
    }
    const Material material = load_material(world.materials, at.material);
    const BrdfValue value = brdf_eval(material, at.albedo, at.n, at.viewer, wi);
    const float2 density = brdf_pdf(material, at.albedo, at.n, at.viewer, wi);
    s.diffuse = value.diffuse * cosine;
    s.specular = value.specular * cosine;
    s.density = fmax(density.x + density.y, 1e-20f);
    return s;
}

// A direction sampled by the reflectance; u in [0, 1)^3. `density` is 0 for a perfect mirror's.
static inline Scatter scatter_sampled(const World world, const PathSurface at, float3 u)
{
    if (at.material < 0)
        return scatter_along(world, at, frame_to_world(build_frame(at.n), sample_cosine(u.xy)));
    const Material material = load_material(world.materials, at.material);
    const BrdfSample sample = brdf_sample(material, at.albedo, at.n, at.viewer, u);
    if (sample.specular && !(material.alpha > 0.0f)) {
        Scatter s = no_scatter(sample.wi);
        s.specular = sample.weight;
        return s;
    }
    return scatter_along(world, at, sample.wi);
}

#ifdef LIGHT_SAMPLING
// A direction about the capture centre, from samples that were drawn beforehand; u in [0, 1)^2.
static inline float3 environment_direction(int count, __global const float4 *restrict samples,
                                           float2 u)
{
    const float4 at = samples[min((int)(u.x * count), count - 1)];
    const float y = mix(at.z, at.w, u.y), s = sqrt(fmax(1.0f - y * y, 0.0f));
    return (float3)(-s * at.y, y, s * at.x);
}
#endif

#ifdef LEARNED_RADIANCE
#define PATH_RADIANCE(hit, o, d) path_radiance(world, hit, o, d)

// Radiance without objects of what a ray from o in direction d has hit.
static inline float3 path_radiance(const World world, const RealHit hit, float3 o, float3 d)
{
    const float4 plane = world.real.surface[hit.texel];
    float4 known = (float4)(0.0f);
    if (hit.kind <= HIT_BACK_FACE && !((int)plane.w & SURFACE_OPENING))
        known = learned_radiance(world.real.learned, o + hit.t * d,
                                 safe_normalize(-plane.xyz, (float3)(0.0f, 1.0f, 0.0f)));
    return known.w > 0.0f ? known.xyz : captured_radiance(world, hit, d);
}
#else
#define PATH_RADIANCE(hit, o, d) captured_radiance(world, hit, d)
#endif

// One path from a surface. All of it is one loop with one call of each march, because OpenCL
// compilers inline them.
static inline ALWAYS_INLINE PathSums trace_pairs(
    const World world, PathSurface at, uint seed, uint index, int environment_count,
    __global const float4 *restrict environment_samples, float4 plane)
{
    PathSums sums;
    sums.diffuse = sums.specular = (float3)(0.0f);
#ifdef ONE_PASS
    sums.unoccluded = sums.passing = (float3)(0.0f);
#else
    sums.blocked = (float3)(0.0f);
#endif
    sums.met = 0;
    // `first_*` belong to the first surface, `throughput` to those after it.
    float first_diffuse = 1.0f;
    float3 first_specular = (float3)(0.0f), throughput = (float3)(1.0f);
    for (int ray = 0; ray < RAYS_PER_BOUNCE * MAX_BOUNCES; ray++) {
        const int bounce = ray / RAYS_PER_BOUNCE;
        const int delta = bounce == 0 && at.material < 0;
        const float2 u = rotated_sobol(index, 2 * ray, seed);
        Scatter s;
#ifdef LIGHT_SAMPLING
        if (ray % 2 == 0) {
            if (environment_count == 0 || world.lights.count == 0)
                continue;
            const float3 light =
                environment_direction(environment_count, environment_samples, u);
            const int texel = texel_towards(world.real, light);
            s = scatter_along(world, at, towards_light(world.real, light, texel, at.o));
            s.aimed = 1;
            s.texel = texel;
        } else
#endif
            s = scatter_sampled(world, at,
                                (float3)(u, rotated_sobol(index, 2 * ray + 1, seed).x));
        const int dark = !(s.diffuse + s.specular.x + s.specular.y + s.specular.z > 0.0f);
        if (dark && s.aimed)
            continue;
        if (dark)
            return sums;

        ObjectHit hit;
        hit.t = INFINITY;
        const int object = trace_objects(world.objects, at.o_object, s.wi, INFINITY, &hit);
#ifndef ONE_PASS
        // What reaches a real surface past the objects is in the picture already.
        if (delta && !object && s.aimed)
            continue;
        if (delta && !object)
            return sums;
#endif
        RealHit real = trace_real_layer(world.real, at.o, s.wi, delta ? INFINITY : hit.t);
        int aimed_at = !s.aimed;
#ifdef LIGHT_SAMPLING
        const float light = light_density(world.lights, world.real, real, at.o, s.wi);
        aimed_at |= light > 0.0f && real.texel == s.texel;
#else
        const float light = 0.0f;
#endif
        const float density = s.density > 0.0f ? s.density + light : 1.0f;
#ifdef DISTANT_ENVIRONMENT
        const float towards = dot(plane.xyz, s.wi);
        const float to_plane = (plane.w - dot(plane.xyz, at.o)) / towards;
        float inverse = 1.0f / density;
        if (towards < 0.0f && to_plane > 0.0f && !delta) {
            real.t = to_plane;
            real.direction = normalize(at.o + to_plane * s.wi);
            inverse = s.density > 0.0f ? 1.0f / s.density : 1.0f;
            aimed_at = !s.aimed;
        }
#else
        const float inverse = 1.0f / density;
#endif
        // The face that an object stands on and the surface below it are one: the object's is met.
        const int at_object = object && !(real.t < hit.t - world.real.bias);
        sums.met |= bounce == 0 && at_object;
        const float3 passed = bounce == 0 ? (float3)(1.0f) : at.albedo * s.diffuse + s.specular;
        if (aimed_at && (delta || !at_object)) {
            const float3 arriving =
                inverse * throughput * passed * PATH_RADIANCE(real, at.o, s.wi);
            if (delta) {
#ifdef ONE_PASS
                sums.unoccluded += s.diffuse * arriving;
                sums.passing += at_object ? (float3)(0.0f) : s.diffuse * arriving;
#else
                sums.blocked += at_object ? s.diffuse * arriving : (float3)(0.0f);
#endif
            } else {
                sums.diffuse += (bounce == 0 ? s.diffuse : first_diffuse) * arriving;
                sums.specular += (bounce == 0 ? s.specular : first_specular) * arriving;
            }
        }
        if (s.aimed)
            continue;
        if (!at_object)
            return sums;
        const float own = s.density > 0.0f ? 1.0f / s.density : 1.0f;
        if (bounce == 0) {
            first_diffuse = own * s.diffuse;
            first_specular = own * s.specular;
        } else {
            throughput *= own * passed;
        }
        const Scatterer next = object_point(world.objects, hit, at.o_object, s.wi);
        at.o = at.o_object = next.position;
        at.n = next.normal;
        at.viewer = -s.wi;
        at.albedo = next.albedo;
        at.material = next.material;
    }
    return sums;
}

#endif
