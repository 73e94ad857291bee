// The real scene as rays see it: one tangent plane per panorama texel, with a finite thickness, joined to
// its neighbours where the depth is continuous.
//
// surface[texel].xyz = g, with g.x = 1 for the points x of the tangent plane (radial distance along the
// unit direction v: 1 / (g.v)); g = 0 where there is no surface. surface[texel].w holds flags.
//
// -D BACKGROUND: a second layer holds, per texel, the farthest surface that the video has shown there
// (remember.cl). It equals the first layer where nothing nearer hides it (background.h).
// -D IMPOSTOR: rays do not march but intersect the distance impostor (impostor.h).
#pragma once

#include "maths/grid.h"
#include "maths/kernel_attributes.h"
#include <iprt.world.real.panorama>
#include "world/real/impostor.h"

#define SURFACE_EAST 1      // connected with the neighbour in that direction
#define SURFACE_WEST 2
#define SURFACE_NORTH 4
#define SURFACE_SOUTH 8
#define SURFACE_OPENING 16  // no depth in the source: a window; emits, takes no shadow
#define SURFACE_NONE 32     // open sky
#define SURFACE_HIDDEN 64   // of the background: hidden by the first layer
#define SURFACE_AIMED 128   // the same, and brighter: light sampling aims at it instead

#define HIT_SURFACE 0       // a visible surface
#define HIT_SIDE 1          // the assumed thickness of a surface, from behind or beside
#define HIT_BACK_FACE 2     // an assumed back face
#define HIT_SKY 3           // no hit: open sky
#define HIT_UNKNOWN 4       // no hit: behind visible surfaces, or at the step cap

typedef struct {
    float t;            // metres along the ray; INFINITY for HIT_SKY and HIT_UNKNOWN
    float3 direction;   // towards the hit's radiance in the panorama; with an impostor,
                        // from its centre, of any length
    float radius;       // metres from the capture centre of a hit at `direction`, without an impostor
    int texel;          // of `direction`; with an impostor, of the ray's own direction
    int kind;           // HIT_*
    int behind;         // the hit is background that the first layer hides
} RealHit;

#define SIDE_FRONT 0    // between the capture centre and the surface
#define SIDE_WITHIN 1   // started inside the thickness and not out yet
#define SIDE_BEHIND 2   // behind the first layer; with a background, behind that too
#define SIDE_BETWEEN 3  // behind the first layer, before the background

static inline float real_thickness(const RealLayer layer, float r)
{
    return larger(layer.thickness_m, layer.thickness_ratio * r);
}

// Return the index of the texel in a direction of any length.
static inline int texel_towards(const RealLayer layer, float3 d)
{
    return sized_texel(equirect_uv(d), layer.grid.width, layer.grid.height, layer.grid.size);
}

static inline int real_skip(const RealLayer layer, int *side, float near, float far, float2 range,
                            int cell)
{
#ifdef BACKGROUND
    if (*side == SIDE_BETWEEN)
        return near > range.y + real_thickness(layer, range.y) && far < layer.background.range[cell].x;
    if (*side == SIDE_BEHIND)
        range = layer.background.range[cell];
#endif
    // A ray that was on the other side of these surfaces has just crossed one, or a gap.
    if (*side != SIDE_BEHIND && far < range.x) {
        *side = SIDE_FRONT;
        return 1;
    }
    return *side == SIDE_BEHIND && near > range.y + real_thickness(layer, range.y);
}

// Return the radial distance of the texel's surface in the direction of m + u d (root = |m + u d|).
static inline float surface_radius(float gm, float gd, float u, float root, float2 range)
{
    float inverse = gm + u * gd;
    return inverse > 0.0f ? smaller(larger(root / inverse, range.x), range.y) : range.y;
}

// Put a hit at u on the ray.
static inline ALWAYS_INLINE void meet_at(const PolarRay ray, float u, RealHit *hit)
{
    const float3 v = ray.m + u * ray.d;
    const float root = length(v);
    hit->t = fmax(polar_t(ray, u), 0.0f);
    hit->direction = v / root;
    hit->radius = ray.b * root;
}

// Return the point of a hit other than HIT_SKY and HIT_UNKNOWN. Rays need not keep their start for it.
static inline ALWAYS_INLINE float3 hit_point(const RealHit hit)
{
    return hit.radius * hit.direction;
}

// Offset of rays above a real surface, in texel footprints.
#define REAL_LIFT 2.0f

// Return the start of rays that leave a real surface at p with normal n. A texel at an edge shows one of
// two surfaces. A point behind the other one is moved before it, or its rays would leave the scene.
static inline float3 real_start(const RealLayer layer, float3 p, float3 n)
{
    const float lift = fmax(layer.bias, REAL_LIFT * IPRT_PI * length(p) / layer.grid.size.y);
    const float3 o = p + lift * n;
    const int texel = texel_towards(layer, o);
    const float r = length(o);
    const float radius = surface_radius(0.0f, dot(layer.surface[texel].xyz, o / r), 1.0f, 1.0f,
                                        layer.grid.range[texel]);
    return r > radius && r <= radius + lift ? o * (radius / r) : o;
}

// Intersect a ray with the assumed back face behind the edge of a visible surface, IPRT Figure 4, in the
// plane of the ray and the capture centre, with the axes m and d. The back face starts at the edge point g1,
// perpendicular to the surface. The ray meets it at p; p' lies as far from g1 along the surface. Returns 1 and
// the hit if the panorama shows p' on that same surface. `outward` is the surface's g in that plane, and
// `size` the length of g.
static inline int back_face(const RealLayer layer, const PolarRay ray, const Segment at, float2 outward,
                            float size, float radius, RealHit *hit)
{
    const float in_plane = length(outward);
    if (!(in_plane > 1e-3f * size))
        return 0;
    const float2 behind = outward / in_plane;
    const float2 edge = (float2)(1.0f, at.u0) / at.root0;
    // Into the surface, the way the ray's direction turns.
    float2 along = (float2)(-behind.y, behind.x);
    along *= along.y - edge.y * dot(edge, along) < 0.0f ? -1.0f : 1.0f;
    if (!(along.y > 1e-4f))
        return 0;   // theta <= 0: the ray moves away from the back face
    const float beyond = ray.b * at.root0 - radius; // of the ray's start from g1, along `edge`
    const float travel = fmax(-beyond * dot(edge, along) / along.y, 0.0f);
    const float depth = beyond * dot(edge, behind) + travel * behind.y;
    if (!(depth > 0.0f))
        return 0;
    const float2 substitute = radius * edge + depth * along;
    const float reach = length(substitute);
    const float3 direction = (substitute.x * ray.m + substitute.y * ray.d) / reach;
    const int texel = texel_towards(layer, direction);
    const float2 range = layer.grid.range[texel];
    const float tolerance = 0.5f * real_thickness(layer, reach);
    if (reach < range.x - tolerance || reach > range.y + tolerance)
        return 0;
    hit->t = polar_t(ray, at.u0) + travel;
    hit->direction = direction;
    hit->radius = reach;
    hit->texel = texel;
    hit->kind = HIT_BACK_FACE;
    return 1;
}

#include "world/real/background.h"

// Intersect a ray with one texel. Surfaces are watertight across connected edges: a ray on different sides
// of two connected neighbours has crossed the surface between them.
static inline int real_leaf(const RealLayer layer, const PolarRay ray, const Segment at, int *side,
                     RealHit *hit)
{
    const int texel = at.row * layer.grid.width + at.column;
    const float4 surface = layer.surface[texel];
    const int flags = (int)surface.w;
    if (flags & SURFACE_NONE) {
        *side = SIDE_FRONT;
        return 0;
    }
    const float2 range = layer.grid.range[texel];
    const float gm = dot(surface.xyz, ray.m), gd = dot(surface.xyz, ray.d);
    const float radius0 = surface_radius(gm, gd, at.u0, at.root0, range);
    const float radius1 = surface_radius(gm, gd, at.u1, at.root1, range);
    const float behind0 = ray.b * at.root0 - radius0;
    const float behind1 = ray.b * at.root1 - radius1;
    const float thickness0 = real_thickness(layer, radius0);
    const float thickness1 = real_thickness(layer, radius1);

    const int edge = at.entry == ENTRY_WEST ? SURFACE_WEST
        : at.entry == ENTRY_EAST            ? SURFACE_EAST
        : at.entry == ENTRY_NORTH           ? SURFACE_NORTH
                                            : SURFACE_SOUTH;
    int connected = flags & edge;
    hit->texel = texel;
#ifdef BACKGROUND
    hit->behind = 0;
    const float4 back = layer.background.surface[texel];
    const int back_flags = (int)back.w;
    if (back_flags & SURFACE_HIDDEN)
        return hidden_leaf(layer, ray, at, edge, surface, back, side, hit);
    // Here the first layer is also the background. The ray may come from a texel between the two.
    if (*side == SIDE_BETWEEN) {
        const int out = behind0 <= 0.0f && connected;
        *side = out ? SIDE_BEHIND : SIDE_FRONT;
        connected = out ? connected : back_flags & edge;
    } else {
        connected |= back_flags & edge;
    }
#endif
    hit->kind = HIT_SURFACE;
    float u = at.u0;
    int found = 0;
    if (at.entry == ENTRY_START) {
        // A start just below a surface counts as on it: the ray hits if it heads deeper.
        *side = behind0 <= thickness0 ? SIDE_WITHIN : SIDE_BEHIND;
        found = behind0 > 0.0f && behind0 <= layer.bias && behind1 > behind0;
    } else if (*side == SIDE_FRONT && behind0 > 0.0f) {
        if (!connected) {
            if (layer.back_faces
                && back_face(layer, ray, at, (float2)(gm, gd), length(surface.xyz), radius0, hit))
                return 1;
            hit->kind = HIT_SIDE;
        }
        found = connected || behind0 <= thickness0;
        *side = SIDE_BEHIND;
    } else if (*side == SIDE_BEHIND) {
        hit->kind = HIT_SIDE;
        found = behind0 <= thickness0 && (behind0 > 0.0f || connected);
    } else if (*side == SIDE_WITHIN && behind0 > thickness0) {
        *side = SIDE_BEHIND;
    }
    if (behind0 <= 0.0f)
        *side = SIDE_FRONT;

    if (!found && *side == SIDE_FRONT && behind1 > 0.0f) {
        hit->kind = HIT_SURFACE;
        found = 1;
        u = (1.0f / ray.b - gm) / gd;
        // Where the radius is clamped there is no plane to intersect: the exit is close enough.
        u = u >= at.u0 && u <= at.u1 ? u : at.u1;
    } else if (!found && *side == SIDE_BEHIND && behind1 <= thickness1) {
        hit->kind = HIT_SIDE;
        found = 1;
        u = at.u1;
    } else if (!found && *side == SIDE_WITHIN) {
        *side = behind1 <= 0.0f ? SIDE_FRONT : behind1 > thickness1 ? SIDE_BEHIND : SIDE_WITHIN;
    }
    if (!found)
        return 0;
    meet_at(ray, u, hit);
    return 1;
}

#define MARCH_NAME march_real_layer
#define MARCH_LAYER RealLayer
#define MARCH_STATE int
#define MARCH_HIT RealHit
#define MARCH_WORK WORK_REAL
#define MARCH_SKIP(state, near, far, range, cell)                                                  \
    real_skip(layer, &state, near, far, range, cell)
#define MARCH_LEAF(layer, ray, at, state, hit) real_leaf(layer, ray, at, state, hit)
#define MARCH_END(state) (state == SIDE_BEHIND ? -1 : 0)
#include "world/real/march.h"

// Intersect a ray whose line passes so close to the capture centre that the direction of closest approach
// is rounding noise. It stays in the texel where it starts and in the one it heads for.
static inline int radial_real(const RealLayer layer, const PolarRay ray, RealHit *hit)
{
    const int texel = texel_towards(layer, ray.d);
    const float4 surface = layer.surface[texel];
    hit->texel = texel;
    if ((int)surface.w & SURFACE_NONE)
        return 0;
    const float2 range = layer.grid.range[texel];
    const float radius = surface_radius(0.0f, dot(surface.xyz, ray.d), 1.0f, 1.0f, range);
    if (ray.od > radius + layer.bias) {
#ifdef BACKGROUND
        return radial_background(layer, ray, texel, hit);
#else
        return -1;
#endif
    }
    hit->kind = HIT_SURFACE;
    hit->t = fmax(radius - ray.od, 0.0f);
    hit->direction = ray.d;
    hit->radius = ray.od + hit->t;
    return 1;
}

#if defined(SUN) || defined(VIRTUAL_LIGHTS)
// Return whether a ray left the room, through an opening or to open sky.
static inline int leaves_room(const RealLayer layer, const RealHit hit)
{
    if (hit.kind != HIT_SURFACE)
        return hit.kind == HIT_SKY || (hit.kind == HIT_UNKNOWN && layer.sun.outdoors);
    const float4 surface = (hit.behind ? layer.background.surface : layer.surface)[hit.texel];
    return ((int)surface.w & SURFACE_OPENING) != 0;
}
#endif

// Return the nearest real surface along the ray, up to t_max. Always fills the hit: a ray that leaves the
// scene takes the panorama's radiance in its own direction.
static inline ALWAYS_INLINE RealHit trace_real_layer(
    const RealLayer layer, float3 o, float3 d, float t_max)
{
    RealHit hit;
    if (!is_ray(o, d)) {
        hit.t = INFINITY;
        hit.direction = (float3)(0.0f, 1.0f, 0.0f);
        hit.radius = INFINITY;
        hit.texel = 0;
        hit.kind = HIT_UNKNOWN;
        hit.behind = 0;
        return hit;
    }
    // Constants: registers would hold other defaults along the march.
    hit.t = hit.radius = 0.0f;
    hit.direction = (float3)(0.0f);
    hit.texel = hit.kind = hit.behind = 0;
#ifdef IMPOSTOR
    hit.kind = HIT_SURFACE;
    hit.radius = INFINITY;
    hit.texel = texel_towards(layer, d);
    COUNT_RAY(layer.grid.work, WORK_REAL);
    COUNT_STEPS(layer.grid.work, WORK_REAL, layer.impostor.steps);
    const float3 x = o - layer.impostor.centre.xyz;
    hit.t = trace_impostor(layer.impostor, x, d);
    hit.direction = x + hit.t * d;
    if (!(impostor_inverse_distance(layer.impostor, hit.direction) > 0.0f)) {
        hit.t = INFINITY;
        hit.kind = HIT_SKY;
    }
    return hit;
#else
    int found = 0;
#ifndef DISTANT_ENVIRONMENT
    COUNT_RAY(layer.grid.work, WORK_REAL);
    const PolarRay ray = polar_ray(o, d);
    // Beyond this radius there is nothing to hit.
    const float t_last = fmin(t_max, fabs(ray.od) + 1.25f * layer.farthest);
    if (!(layer.farthest > 0.0f))
        found = 0;
    else if (!(5e3f * ray.b > layer.nearest))
        found = radial_real(layer, ray, &hit);
    else
        found = march_real_layer(layer, ray, 0.0f, t_last, SIDE_FRONT, &hit);
#endif
    if (found != 1) {
        hit.t = INFINITY;
        hit.texel = texel_towards(layer, d);
        hit.direction = d;
        hit.radius = INFINITY;
        hit.kind = found == 0 ? HIT_SKY : HIT_UNKNOWN;
#ifdef BACKGROUND
        hit.behind = found == 0 && sky_behind(layer, hit.texel);
#endif
    }
    return hit;
#endif
}
