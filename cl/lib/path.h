// Paths through the mixed scene: what arrives along a ray that meets real surfaces, which end it
// with the radiance that the panorama shows, and virtual ones, which scatter it on.
//
// Real surfaces are taken as diffuse emitters (IPRT, "Interactive panoramic ray tracing"): the
// panorama already holds every bounce between them. -D MAX_BOUNCES is how many virtual surfaces a
// path may meet; the ray after the last one sees real surfaces only (Algorithm 1, lines 4-6).
// -D RELIT multiplies real radiance by what objects do to it (UpdateGbuffer): in the view where
// that shows the surface, else in the panorama.
// -D REAL_GLOSS lets glossy real surfaces reflect as well, once, what they show being what they radiate
// to all sides only (iprt/passes/highlight.py).
// -D OPENING_ENVIRONMENT lets windows show what is far behind them in the ray's direction, rather
// than the radiance of the point where the ray crosses them.
// -D DISTANT_ENVIRONMENT takes the panorama as infinitely far: image-based lighting.
// -D LIGHT_SAMPLING aims a share of the rays at the bright parts of the panorama; the densities of
// both ways to choose a direction are mixed (one-sample balance heuristic: Veach and Guibas,
// "Optimally Combining Sampling Techniques for Monte Carlo Rendering", SIGGRAPH 1995).
#ifndef IPRT_PATH_H
#define IPRT_PATH_H

#include "boxes.h"
#include "brdf.h"
#ifdef REAL_GLOSS
#include "gloss.h"
#endif
#include "lights.h"
#include "panorama.h"
#include "sampling.h"
#include "scene.h"
#include "tracing.h"
#include "view.h"

// Rays leave a real surface this many texel footprints above it.
#define REAL_LIFT 2.0f
// Narrower lobes find lights better than aiming does.
#define AIMED_ALPHA 0.02f

// What objects do to the radiance of real surfaces, as factors.
typedef struct {
    __global const float4 *screen;      // per pixel of the view, [width * height]
    __global const float *view;         // lib/view.h; of the screen
    int width;
    int height;
    __global const float4 *panorama;    // [rows * 2 rows], equirect
    int rows;
} Relit;

// Glossy real surfaces.
typedef struct {
    __global const uchar *map;              // per texel: 0 diffuse, else 1 + index of the material
    __global const float4 *materials;       // lib/brdf.h
    __global const float4 *reflectance;     // per material: of conductors
    __global const float4 *gain;            // per cell (lib/gloss.h): what was seen of highlights
    int columns;                            // cells
    int rows;
} Gloss;

typedef struct {
    RealLayer real;
    __global const float4 *color;       // panorama radiance
    __global const float4 *outside;     // [OUTSIDE_ROWS * 2 OUTSIDE_ROWS], seen through windows
    Objects objects;
    __global const float4 *materials;   // lib/brdf.h
    Lights lights;
    Relit relit;
    Gloss gloss;
} World;

// What every kernel that traces paths is given, in this order (iprt/passes/world.py).
#define WORLD_PARAMETERS                                                                           \
    REAL_PARAMETERS, OBJECT_PARAMETERS, LIGHT_PARAMETERS,                                          \
        __global const float4 *restrict relit_screen, __global const float *restrict relit_view,   \
        const int relit_width, const int relit_height,                                             \
        __global const float4 *restrict relit_panorama, const int relit_rows,                      \
        __global const uchar *restrict real_gloss, __global const float4 *restrict real_materials, \
        __global const float4 *restrict real_reflectance,                                          \
        __global const float4 *restrict real_gain, const int gain_columns, const int gain_rows

#define WORLD(view)                                                                                \
    {                                                                                              \
        REAL_LAYER, real_color, real_outside, OBJECTS(view), materials, LIGHTS,                    \
        {                                                                                          \
            relit_screen, relit_view, relit_width, relit_height, relit_panorama, relit_rows        \
        },                                                                                         \
        {                                                                                          \
            real_gloss, real_materials, real_reflectance, real_gain, gain_columns, gain_rows       \
        }                                                                                          \
    }

// Where rays leave a real surface.
static inline float3 real_start(const RealLayer layer, float3 p, float3 n)
{
    const float footprint = IPRT_PI / layer.grid.height;
    return p + fmax(layer.bias, REAL_LIFT * footprint * length(p)) * n;
}

static inline float3 sky_radiance(const World world, float3 d)
{
    return panorama_bilinear(world.color, world.real.grid.width, world.real.grid.height,
                             equirect_uv(d));
}

#ifdef RELIT
// Where d leads from the capture centre.
static inline float3 relit_factor(const Relit relit, float3 d)
{
    if (relit.screen != 0) {
        const float2 p = view_project(relit.view, d);
        if (p.x >= 0.0f && p.y >= 0.0f && p.x < relit.width && p.y < relit.height)
            return relit.screen[(int)p.y * relit.width + (int)p.x].xyz;
    }
    if (relit.panorama == 0)
        return (float3)(1.0f);
    return panorama_bilinear(relit.panorama, 2 * relit.rows, relit.rows, equirect_uv(d));
}
#endif

// Radiance without objects of what a ray in direction d has hit. One lookup, whichever picture it is
// in.
static inline float3 captured_radiance(const World world, const RealHit hit, float3 d)
{
    __global const float4 *picture = world.color;
    int width = world.real.grid.width, height = world.real.grid.height;
    float2 uv = equirect_uv(hit.direction);
    __global const float4 *surfaces = world.real.surface;
#ifdef BACKGROUND
    if (hit.behind) {
        picture = world.real.back_color;
        surfaces = world.real.back_surface;
    }
#endif
    const int surface = hit.kind <= HIT_BACK_FACE;
#ifdef OPENING_ENVIRONMENT
    if (surface && (int)surfaces[hit.texel].w & SURFACE_OPENING) {
        // Behind windows: as the camera saw it in that direction, or else extrapolated.
        uv = equirect_uv(d);
        const int texel = min((int)(uv.y * height), height - 1) * width
            + min((int)(uv.x * width), width - 1);
#ifdef BACKGROUND
        picture = world.real.back_color;
        surfaces = world.real.back_surface;
#endif
        if (!((int)surfaces[texel].w & SURFACE_OPENING)) {
            picture = world.outside;
            width = 2 * OUTSIDE_ROWS;
            height = OUTSIDE_ROWS;
        }
    }
#endif
    return panorama_bilinear(picture, width, height, uv);
}

// The same, with what objects do to it.
static inline float3 real_radiance(const World world, const RealHit hit, float3 d)
{
    float3 radiance = captured_radiance(world, hit, d);
#ifdef RELIT
#ifdef BACKGROUND
    // What objects do to surfaces that the view does not show is not known.
    if (hit.behind)
        return radiance;
#endif
    if (hit.kind <= HIT_BACK_FACE)
        radiance *= relit_factor(world.relit, hit.direction);
#endif
    return radiance;
}

// A direction in which a surface passes light on, and what its density was.
typedef struct {
    float3 wi;
    float3 diffuse;       // f cos, without the albedo
    float3 specular;      // f cos
    float density;        // with which wi was chosen, but for light sampling; 0: a perfect mirror's,
                          // whose f cos holds the density already
    float light_share;    // probability of aiming at lights instead
    float box_share;      // and at objects' boxes (-D DELTA)
    float3 light;         // where it was aimed at, from the capture centre
    int aimed;            // at a light: nothing else counts
} Scatter;

static inline Scatter no_scatter(float3 wi)
{
    Scatter s;
    s.wi = wi;
    s.diffuse = s.specular = (float3)(0.0f);
    s.density = s.light_share = s.box_share = 0.0f;
    s.light = wi;
    s.aimed = 0;
    return s;
}

static inline float light_share(const World world, const Material material)
{
#ifdef LIGHT_SAMPLING
    if (world.lights.count == 0)
        return 0.0f;
    if (material.kind == KIND_DIFFUSE)
        return 0.5f;
    return material.kind == KIND_PLASTIC ? 0.35f : material.alpha > AIMED_ALPHA ? 0.25f : 0.0f;
#else
    return 0.0f;
#endif
}

// One direction off a virtual surface at x; u in [0, 1)^4.
static inline Scatter scatter(const World world, const Material material, float3 albedo, float3 x,
                              float3 n, float3 wo, float4 u)
{
    Scatter s = no_scatter(n);
    s.light_share = light_share(world, material);
    s.aimed = u.w < s.light_share;
    const float rest = 1.0f - s.light_share;
    if (s.aimed) {
        s.light = sample_light(world.lights, u.xy);
        s.wi = towards_light(world.real, s.light, x);
    } else {
        const BrdfSample sample = brdf_sample(material, albedo, n, wo, u.xyz);
        s.wi = sample.wi;
        if (sample.specular && !(material.alpha > 0.0f)) {
            s.specular = sample.weight / rest;
            return s;
        }
    }
    const BrdfValue value = brdf_eval(material, albedo, n, wo, s.wi);
    const float2 density = brdf_pdf(material, albedo, n, wo, s.wi);
    const float cosine = fmax(dot(n, s.wi), 0.0f);
    s.diffuse = (float3)(value.diffuse * cosine);
    s.specular = value.specular * cosine;
    // Directions below the surface pass no light on, whatever their density.
    s.density = fmax(rest * (density.x + density.y), 1e-20f);
    return s;
}

#ifndef DISTANT_ENVIRONMENT

// 1 / density of what a ray from o met: 0 if it was aimed at a light and met something else.
static inline float inverse_density(const World world, const Scatter s, float3 o, const RealHit hit)
{
    float density = s.density;
    if (!(density > 0.0f))
        return 1.0f;
#ifdef LIGHT_SAMPLING
    if (s.light_share > 0.0f) {
        const float light = light_density(world.lights, world.real, hit, o, s.wi);
        // What has no density of light sampling is for the other ways to bring in, alone.
        if (s.aimed && !(light > 0.0f && reaches_light(world.real, hit, s.light)))
            return 0.0f;
        density += s.light_share * light;
    }
#endif
    return 1.0f / density;
}

// One path from a point. Objects are looked for from o_object, real surfaces from o.
typedef struct {
    float3 arriving;    // radiance over density at the start, objects included
    float3 real;        // the same if there were no objects
    float distance;     // to the first thing that the path meets, metres; INFINITY: sky
    int met;            // that is an object
} PathResult;

#ifdef REAL_GLOSS
// Index + 1 of the material of a glossy real surface that a ray has hit, else 0.
static inline int gloss_at(const World world, const RealHit hit)
{
    int seen = hit.kind == HIT_SURFACE
        && !((int)world.real.surface[hit.texel].w & SURFACE_OPENING);
#ifdef BACKGROUND
    seen &= !hit.behind;
#endif
    return seen ? world.gloss.map[hit.texel] : 0;
}

// How much of a computed reflection in a real surface at p the camera can have seen. Of a conductor
// nothing else was seen that would tell.
static inline float3 seen_share(const World world, const Material material, float3 p)
{
    const float2 texel = equirect_uv(p)
        * (float2)((float)world.real.grid.width, (float)world.real.grid.height);
    return material.kind == KIND_CONDUCTOR
        ? (float3)(1.0f) : gain_at(world.gloss.gain, world.gloss.columns, world.gloss.rows, texel);
}

// The direction in which a glossy real surface at p with normal n reflects a ray along d.
static inline BrdfSample reflect_real(const World world, int index, float3 p, float3 n, float3 d,
                                      float2 u)
{
    const Material material = load_material(world.gloss.materials, index);
    const Frame frame = build_frame(n);
    BrdfSample sample = sample_specular(material, world.gloss.reflectance[index].xyz, frame,
                                        brdf_local_wo(frame, -d), u);
    sample.weight *= seen_share(world, material, p);
    return sample;
}
#endif

// All of a path is one loop with one call of each march, because OpenCL compilers inline them.
// -D WITHOUT_OBJECTS also fills `real`, which costs tracing past the objects.
// -D DELTA is for what objects change only: paths whose first surface is none are not followed,
// and `real` is what the first object hides. `boxes` are seen from o_object.
static inline PathResult trace_path(const World world, float3 o, float3 o_object, Scatter s,
#ifdef DELTA
                                    const BoxView boxes,
#endif
                                    uint seed, uint index)
{
    PathResult result;
    result.met = 0;
    result.distance = INFINITY;
    result.real = result.arriving = (float3)(0.0f);
    float3 throughput = (float3)(1.0f);
#ifdef REAL_GLOSS
    int reflected = 0;
#endif
    // One more for a glossy real surface, and one for what is seen in the last.
    for (int bounce = 0; bounce < MAX_BOUNCES + 2; bounce++) {
        const float3 d = s.wi;
        ObjectHit hit;
        hit.t = INFINITY;
        const int object = bounce < MAX_BOUNCES
            && trace_objects(world.objects, o_object, d, INFINITY, &hit);
#ifdef DELTA
        if (bounce == 0) {
            if (!object)
                return result;
            if (s.box_share > 0.0f)
                s.density += s.box_share
                    * box_density(world.objects.bounds, world.objects.objects, boxes, d);
        }
#endif
#if defined(WITHOUT_OBJECTS) || defined(DELTA)
        const float t_max = object && bounce > 0 ? hit.t : INFINITY;
#else
        const float t_max = object ? hit.t : INFINITY;
#endif
        const RealHit real = trace_real_layer(world.real, o, d, t_max);
        // The face that an object stands on and the surface below it are one: the object's is met, or
        // light would leak into it.
        const int at_object = object && !(real.t < hit.t - world.real.bias);
        if (bounce == 0)
            result.distance = at_object ? hit.t : real.t;
#ifdef WITHOUT_OBJECTS
        if (bounce == 0)
            result.real = real_radiance(world, real, d);
#endif
        if (!at_object) {
#ifdef DELTA
            if (bounce == 0)
                return result;
#endif
#ifdef WITHOUT_OBJECTS
            // The same value bit for bit where no object is met.
            if (bounce == 0) {
                result.arriving = result.real;
                return result;
            }
#endif
            const float share = inverse_density(world, s, o, real);
            if (!(share > 0.0f))
                return result;
            throughput *= share;
#ifdef REAL_GLOSS
            const int gloss = reflected ? 0 : gloss_at(world, real);
            if (gloss) {
                // A conductor shows nothing but its reflection.
                if (load_material(world.gloss.materials, gloss - 1).kind != KIND_CONDUCTOR)
                    result.arriving += throughput * real_radiance(world, real, d);
                const float3 n = -normalize(world.real.surface[real.texel].xyz), p = o + real.t * d;
                const BrdfSample shine =
                    reflect_real(world, gloss - 1, p, n, d,
                                 sobol_2d(index, hash_combine(seed, 2 * bounce + 3)));
                throughput *= shine.weight;
                if (!(throughput.x + throughput.y + throughput.z > 0.0f))
                    return result;
                o = real_start(world.real, p, n);
                o_object = p + world.real.bias * n;
                s = no_scatter(shine.wi);
                reflected = 1;
                continue;
            }
#endif
            result.arriving += throughput * real_radiance(world, real, d);
            return result;
        }
#ifdef DELTA
        if (bounce == 0) {
            const float share = inverse_density(world, s, o, real);
            if (!(share > 0.0f))
                return result;
            result.real = share * captured_radiance(world, real, d);
            throughput *= share;
        } else
#endif
        {
            if (s.aimed)
                return result;
            throughput *= s.density > 0.0f ? 1.0f / s.density : 1.0f;
        }
        result.met |= bounce == 0;
        const Scatterer at = object_point(world.objects, hit, o_object, d);
        const uint stream = hash_combine(seed, 2 * bounce + 2);
        const float2 u = sobol_2d(index, stream), v = sobol_2d(index, hash_combine(stream, 1));
        o = o_object = at.position;
        s = scatter(world, load_material(world.materials, at.material), at.albedo, o, at.normal, -d,
                    (float4)(u, v));
        throughput *= at.albedo * s.diffuse + s.specular;
        if (!(throughput.x + throughput.y + throughput.z > 0.0f))
            return result;
    }
    return result;
}
#endif

#endif
