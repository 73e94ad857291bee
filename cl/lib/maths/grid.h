// Hierarchy over an equirect image that rays march through, and a ray parametrization in which crossings of
// cell boundaries are cheap.
#pragma once

#include "maths/equirect.h"
#include "maths/work_counters.h"
#include <iprt.world.real.pyramid>

// A ray o + t d seen from the capture centre. Its points are b (m + u d), where m is the unit direction of
// the closest approach, b the distance there, and u = (t + o.d) / b. Then r = b sqrt(1 + u^2), and a
// point's direction is proportional to m + u d.
typedef struct {
    float3 m;
    float3 d;
    float b;
    float od;
} PolarRay;

static inline PolarRay polar_ray(float3 o, float3 d)
{
    PolarRay ray;
    ray.od = dot(o, d);
    float3 m = o - ray.od * d;
    ray.b = length(m);
    ray.m = m / fmax(ray.b, 1e-30f);
    ray.d = d;
    return ray;
}

// Return whether o and d are finite and d is about of unit length: no cell could be computed otherwise.
static inline int is_ray(float3 o, float3 d)
{
    const float length2 = dot(d, d);
    return length2 > 0.25f && length2 < 4.0f && dot(o, o) < 1e30f;
}

static inline float polar_t(const PolarRay ray, float u) { return u * ray.b - ray.od; }
static inline float polar_u(const PolarRay ray, float t) { return (t + ray.od) / ray.b; }

// Rays that graze a wall for metres can skip no cell and take a few hundred steps: up to 640 of 400,000
// random rays in a 2048x1024 panorama of a room.
#define MARCH_STEP_CAP 1024

// Edge by which a ray enters a cell.
#define ENTRY_START 0
#define ENTRY_WEST 1
#define ENTRY_EAST 2
#define ENTRY_NORTH 3
#define ENTRY_SOUTH 4

// The segment of a ray inside one texel.
typedef struct {
    int column;
    int row;
    int entry;     // ENTRY_*
    float u0;      // entry and exit
    float u1;
    float root0;   // sqrt(1 + u^2) there
    float root1;
} Segment;

// Return a crossing, or INFINITY if it lies behind the current point. A crossing that rounding puts
// slightly behind still counts, so that a ray never gets stuck. It is clamped so that no step goes
// backwards.
static inline float ahead(float crossing, float u)
{
    return crossing >= u - 1e-3f * (1.0f + fabs(u)) ? larger(crossing, u) : INFINITY;
}

// Return u where the ray crosses the meridian with normal (edge.x, 0, edge.y), along that normal (sign = 1)
// or against it (sign = -1). A ray that turns the other way never does, even if rounding puts it next to
// the plane. This ends the turn of a ray that passes the polar axis.
static inline float meridian_crossing(const PolarRay ray, float2 edge, float sign, float u)
{
    float nm = edge.x * ray.m.x + edge.y * ray.m.z;
    float nd = edge.x * ray.d.x + edge.y * ray.d.z;
    return sign * nd > 0.0f ? larger(-nm / nd, u) : INFINITY;
}

// Return u where the ray crosses the cone cos(theta) = c upwards (sign = 1) or downwards (sign = -1). The
// poles bound no cell, although rounding may raise a2 above its maximum of 1.
static inline float cone_crossing(const PolarRay ray, float a2, float c, float sign, float u)
{
    float s = sign * sqrt(larger(a2 - c * c, 0.0f));
    float denominator = ray.m.y * c + ray.d.y * s;
    float crossing = (ray.d.y * c - ray.m.y * s) / denominator;
    return c * c < smaller(a2, 1.0f) && denominator > 0.0f ? ahead(crossing, u) : INFINITY;
}

static inline int cells_along(int texels, int level) { return (texels + (1 << level) - 1) >> level; }
