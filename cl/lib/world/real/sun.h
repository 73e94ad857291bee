// A distant light that the panorama does not show (iprt/footage/sun.py): a disc with the same radiance
// everywhere. -D SUN: there is one.
#pragma once

#include "maths/equirect.h"
#include "maths/maths.h"
#include "maths/sampling.h"
#include <iprt.world.real.sun>

#ifdef SUN

// In place of the texel of a light that a ray is aimed at: the sun; and the sun as a surface in it sees it.
#define SUN_TEXEL 0x7fffffff
#define SHADE_TEXEL 0x7ffffffe
// Slightly more than the disc: directions sampled at its rim are rounded.
#define SUN_RIM 1.0001f

// Return the density per solid angle of sample_sun() in the direction d. By the sine, whose rounding errors are
// small for small discs.
static inline float sun_density(const Sun sun, float3 d)
{
    const float3 sine = cross(d, sun.disc.xyz);
    return dot(d, sun.disc.xyz) > 0.0f && dot(sine, sine) <= sun.disc.w * SUN_RIM ? sun.radiance.w : 0.0f;
}

// Sample a unit direction towards the disc; u in [0, 1)^2.
static inline float3 sample_sun(const Sun sun, float2 u)
{
    const float sine2 = sun.disc.w * u.x;
    const float2 beside = sqrt(sine2) * unit_circle(u.y);
    return frame_to_world(build_frame(sun.disc.xyz), (float3)(beside, sqrt(1.0f - sine2)));
}

// Return the irradiance / pi of a surface with normal n that the whole disc reaches.
static inline float3 sun_irradiance(const Sun sun, float3 n)
{
    return sun.radiance.xyz / sun.radiance.w * fmax(dot(n, sun.disc.xyz), 0.0f) / IPRT_PI;
}

// Return whether a diffuse surface is in the sun: it shows more than it receives by all other light.
static inline int shows_sun(float shown, float others) { return shown > others; }

// The least reflectance of surfaces in the sun.
#define LEAST_ALBEDO 0.1f

// Return whether a surface would reflect too little of the sun.
static inline int shows_shade(float shown, float others, float sun) { return shown < LEAST_ALBEDO * (others + sun); }

#endif
