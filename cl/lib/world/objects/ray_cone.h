// Ray cones: how wide a ray is, from which the level of a texture follows where it meets one (T. Akenine-Möller, C.
// Crassin, J. Boksansky, L. Belcour, A. Panteleev, O. Wright, "Improved Shader and Texture Level of Detail Using Ray
// Cones", JCGT 10(1), 2021). Programs without textures (-D TEXTURES) drop them.
#pragma once

#include "maths/equirect.h"

// Rays that share a lobe: each is as wide as its part of the lobe's solid angle.
#define LOBE_RAYS 16.0f
// Largest spread that a lobe adds, radians.
#define MOST_SPREAD 1.0f

typedef struct {
    float width;     // metres, where the ray starts
    float spread;    // growth of the width per metre, radians
} RayCone;

static inline float cone_width(RayCone cone, float t) { return cone.width + cone.spread * t; }

// Return the spread of a ray sampled with a density; 0: of the GGX lobe of `alpha`, whose density is 1 / (4 pi alpha^2)
// in its middle. The solid angle of a sample is after J. Křivánek and M. Colbert, "Real-time Shading with Filtered
// Importance Sampling", EGSR 2008.
static inline float lobe_spread(float density, float alpha)
{
    const float solid_angle = density > 0.0f ? 1.0f / density : 4.0f * IPRT_PI * alpha * alpha;
    return fmin(sqrt(solid_angle / LOBE_RAYS), MOST_SPREAD);
}

// Return the cone of a ray that a surface at t sends on. Flat mirrors keep the spread, and so do curved ones here.
static inline RayCone scattered_cone(RayCone cone, float t, float density, float alpha)
{
    const RayCone next = {cone_width(cone, t), cone.spread + lobe_spread(density, alpha)};
    return next;
}
