// Joints between texels and the reach of their planes, for some texels at once (maths/lanes.h).
//
// Two neighbours are connected when the step between them is explained by the tangent plane of
// either, or is below three texel footprints: only other steps are gaps a ray can pass.
#ifndef IPRT_JOINT_H
#define IPRT_JOINT_H

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

// A neighbour with inverse depth `near`, plane h and direction w: whether the texel with depth d,
// plane g and direction v is joined with it. `reach` grows to the step between them, if so.
static inline ints joined(floats d, Vectors g, Vectors v, floats near, Vectors h, Vectors w,
                          float footprint, floats *reach)
{
    const floats e = 1.0f / near, step = fabs(d - e);
    const floats unexplained = fmin(
        step, fmin(fabs(radius_towards(g, w) - e), fabs(radius_towards(h, v) - d)));
    // Not of open sky, which is infinitely far.
    const ints is = unexplained <= STEP_FOOTPRINTS * footprint * fmin(d, e);
    *reach = either(is, fmax(*reach, step), *reach);
    return is;
}

// Takes in the plane's radius towards a corner of the texel.
static inline void corner_radius(Vectors g, Vectors corner, floats *low, floats *high)
{
    const floats radius = radius_towards(g, corner);
    *low = fmin(*low, radius);
    *high = fmax(*high, radius);
}

// Within the texel the radius bends away from that at the corners: second derivative
// r (1 + 2 tan^2) at the angle whose cosine is 1 / (|g| d).
static inline floats radius_bend(Vectors g, floats d, float footprint)
{
    return 0.25f * footprint * footprint * d * (2.0f * along(g, g) * d * d - 1.0f);
}

#endif
