// Paths through the mixed scene: what arrives along a ray that meets real surfaces, which end it
// with the radiance that the panorama shows, and virtual ones, which scatter it on.
//
// Real surfaces are taken as diffuse emitters (IPRT, "Interactive panoramic ray tracing"): the
// panorama already holds every bounce between them. -D MAX_BOUNCES is how many virtual surfaces a
// path may meet; the ray after the last one sees real surfaces only (Algorithm 1, lines 4-6).
// -D RELIT multiplies real radiance by what objects do to it in the view (UpdateGbuffer).
// -D OPENING_ENVIRONMENT lets windows show what is far behind them in the ray's direction, rather
// than the radiance of the point where the ray crosses them.
// -D DISTANT_ENVIRONMENT takes the panorama as infinitely far: image-based lighting.
#ifndef IPRT_PATH_H
#define IPRT_PATH_H

#include "brdf.h"
#include "panorama.h"
#include "sampling.h"
#include "scene.h"

// Kernels that trace, one ray per lane: rays part ways at once, so that Intel's CPU compiler, which
// would pack sixteen of them into a vector, makes code that is half as fast.
#if defined(__has_attribute)
#if __has_attribute(intel_vec_len_hint)
#define TRACING_KERNEL __kernel __attribute__((intel_vec_len_hint(1)))
#endif
#endif
#ifndef TRACING_KERNEL
#define TRACING_KERNEL __kernel
#endif

// Rays leave a real surface this many texel footprints above it.
#define REAL_LIFT 2.0f

typedef struct {
    RealLayer real;
    __global const float4 *color;       // panorama radiance
#ifdef OPENING_ENVIRONMENT
    __global const float4 *outside;     // [OUTSIDE_ROWS * 2 OUTSIDE_ROWS], seen through windows
#endif
#ifdef RELIT
    __global const float4 *ratio;       // E_RV / E_R per pixel of the view
    int view_width;
    int view_height;
#endif
    Objects objects;
    __global const float4 *materials;   // lib/brdf.h
} World;

static inline float3 sky_radiance(const World world, float3 d)
{
    return panorama_bilinear(world.color, world.real.grid.width, world.real.grid.height,
                             equirect_uv(d));
}

// Radiance of what a ray in direction d has hit. One lookup, whichever picture it is in.
static inline float3 real_radiance(const World world, const RealHit hit, float3 d)
{
    __global const float4 *picture = world.color;
    int width = world.real.grid.width, height = world.real.grid.height;
    float2 uv = equirect_uv(hit.direction);
    const int surface = hit.kind <= HIT_BACK_FACE;
#ifdef OPENING_ENVIRONMENT
    if (surface && (int)world.real.surface[hit.texel].w & SURFACE_OPENING) {
        // Behind windows: as the camera saw it in that direction, or else extrapolated.
        uv = equirect_uv(d);
        const int texel = min((int)(uv.y * height), height - 1) * width
            + min((int)(uv.x * width), width - 1);
        if (!((int)world.real.surface[texel].w & SURFACE_OPENING)) {
            picture = world.outside;
            width = 2 * OUTSIDE_ROWS;
            height = OUTSIDE_ROWS;
        }
    }
#endif
    float3 radiance = panorama_bilinear(picture, width, height, uv);
#ifdef RELIT
    if (surface) {
        const float2 p = view_project(world.objects.view, hit.direction);
        if (p.x >= 0.0f && p.y >= 0.0f && p.x < world.view_width && p.y < world.view_height)
            radiance *= world.ratio[(int)p.y * world.view_width + (int)p.x].xyz;
    }
#endif
    return radiance;
}

#ifndef DISTANT_ENVIRONMENT
// One path from a point, from direction d on. Objects are looked for from o_object, real surfaces
// from o.
typedef struct {
    float3 arriving;    // radiance at the start, objects included
    float3 real;        // radiance at the start if there were no objects
    int met;            // an object is the first thing that the path meets
} PathResult;

// All of a path is one loop with one call of each march, because OpenCL compilers inline them.
// `real` is only filled with -D WITHOUT_OBJECTS, which costs tracing past the objects.
static inline PathResult trace_path(const World world, float3 o, float3 o_object, float3 d, uint seed,
                             uint index)
{
    PathResult result;
    result.met = 0;
    result.real = result.arriving = (float3)(0.0f);
    float3 throughput = (float3)(1.0f);
    for (int bounce = 0;; bounce++) {
        ObjectHit hit;
        hit.t = INFINITY;
        const int object = bounce < MAX_BOUNCES
            && trace_objects(world.objects, o_object, d, INFINITY, &hit);
#ifdef WITHOUT_OBJECTS
        const float t_max = object && bounce > 0 ? hit.t : INFINITY;
#else
        const float t_max = object ? hit.t : INFINITY;
#endif
        const RealHit real = trace_real_layer(world.real, o, d, t_max);
        const int at_object = object && !(real.t < hit.t);
#ifdef WITHOUT_OBJECTS
        if (bounce == 0)
            result.real = real_radiance(world, real, d);
#endif
        if (!at_object) {
            // The same value bit for bit where no object is met.
#ifdef WITHOUT_OBJECTS
            if (bounce == 0) {
                result.arriving = result.real;
                return result;
            }
#endif
            result.arriving = throughput * real_radiance(world, real, d);
            return result;
        }
        result.met = 1;
        const Scatterer at = object_point(world.objects, hit, o_object, d);
        const uint stream = hash_combine(seed, 2 * bounce + 2);
        const float2 u = sobol_2d(index, stream);
        const BrdfSample sample =
            brdf_sample(load_material(world.materials, at.material), at.albedo, at.normal, -d,
                        (float3)(u, sobol_1d(index, hash_combine(stream, 1))));
        throughput *= sample.specular ? sample.weight : sample.weight * at.albedo;
        if (!(throughput.x + throughput.y + throughput.z > 0.0f))
            return result;
        d = sample.wi;
        o = o_object = at.position + at.lift * at.normal;
    }
}
#endif

#endif
