// Joints between texels, and depth ranges of their planes, for LANES texels at once (maths/lanes.h).
//
// Two neighbours are connected if the tangent plane of either explains the step between them, or if the
// step is below three texel footprints. Only other steps are gaps that a ray can pass.
#pragma once

#include "maths/lanes.h"
#include "world/real/real.h"

#define STEP_FOOTPRINTS 3.0f

typedef struct {
    floats x, y, z;
} Vectors;

static inline floats along(Vectors g, Vectors v)
{
    return g.x * v.x + g.y * v.y + g.z * v.z;
}

static inline floats radius_towards(Vectors g, Vectors v)
{
    const floats inverse = along(g, v);
    return either(inverse > 0.0f, 1.0f / inverse, (floats)(INFINITY));
}

// Return whether the texel with depth d, plane g and direction v is joined with the neighbour with inverse
// depth `near`, plane h and direction w. If so, `reach` grows to the step between them.
static inline ints joined(floats d, Vectors g, Vectors v, floats near, Vectors h, Vectors w,
                          float footprint, floats *reach)
{
    const floats e = 1.0f / near, step = fabs(d - e);
    const floats unexplained = fmin(
        step, fmin(fabs(radius_towards(g, w) - e), fabs(radius_towards(h, v) - d)));
    // False in open sky, which is infinitely far.
    const ints is = unexplained <= STEP_FOOTPRINTS * footprint * fmin(d, e);
    *reach = either(is, fmax(*reach, step), *reach);
    return is;
}

// Extend the range by the plane's radius towards a corner of the texel.
static inline void corner_radius(Vectors g, Vectors corner, floats *low, floats *high)
{
    const floats radius = radius_towards(g, corner);
    *low = fmin(*low, radius);
    *high = fmax(*high, radius);
}

// Return by how much the radius within the texel may deviate from its values at the corners: second
// derivative r (1 + 2 tan^2) at the angle whose cosine is 1 / (|g| d).
static inline floats radius_bend(Vectors g, floats d, float footprint)
{
    return 0.25f * footprint * footprint * d * (2.0f * along(g, g) * d * d - 1.0f);
}
