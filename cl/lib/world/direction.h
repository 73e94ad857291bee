// Sampled directions of rays from surfaces, and their densities.
//
// A share of the rays is aimed at bright parts of the panorama. The densities of both techniques are
// combined by the one-sample balance heuristic (Veach and Guibas, "Optimally Combining Sampling Techniques
// for Monte Carlo Rendering", SIGGRAPH 1995).
#pragma once

#include "world/world.h"

// A direction in which a surface scatters light, and its density.
typedef struct {
    float3 wi;
    float diffuse;        // f cos, without the albedo
    float3 specular;      // f cos
    float density;        // of wi, without light sampling; 0: a perfect mirror,
                          // whose f cos is divided by the density already
    float light_share;    // probability of aiming at lights instead
#ifdef SUN
    float sun_share;      // and at the sun
#endif
#ifdef LAMPS
    float lamp_share;     // and at emitting objects
    float lamp_distance;  // to the point of one that is aimed at
#endif
#ifdef SAMPLES_VIRTUAL_LIGHTS
    float light_away;     // metres left to the point of a virtual light that is aimed at
#endif
    int texel;            // of the light aimed at: any other hit counts as 0; -1: not aimed
#ifdef REFRACTS
    ulong media;          // that the ray starts in (lib/world/glass.h)
#endif
} Scatter;

static inline Scatter no_scatter(float3 wi)
{
    Scatter s;
    s.wi = wi;
    s.diffuse = 0.0f;
    s.specular = (float3)(0.0f);
    s.density = s.light_share = 0.0f;
#ifdef SUN
    s.sun_share = 0.0f;
#endif
#ifdef LAMPS
    s.lamp_share = s.lamp_distance = 0.0f;
#endif
#ifdef SAMPLES_VIRTUAL_LIGHTS
    s.light_away = 0.0f;
#endif
    s.texel = -1;
#ifdef REFRACTS
    s.media = 0;
#endif
    return s;
}

static inline int is_at_lamp(const Scatter s)
{
#ifdef LAMPS
    return s.texel == LAMP_TEXEL;
#else
    return 0;
#endif
}

// Return whether a ray is aimed at a light without geometry.
static inline int is_at_virtual_light(const Scatter s)
{
#ifdef SAMPLES_VIRTUAL_LIGHTS
    return s.texel >= LIGHT_TEXEL && s.texel < LIGHT_TEXEL + MOST_LIGHTS;
#else
    return 0;
#endif
}

// Return whether a ray is aimed at a light of the panorama or at the sun.
static inline int is_aimed(const Scatter s)
{
    return s.texel >= 0 && !is_at_lamp(s) && !is_at_virtual_light(s);
}

static inline int is_at_sun(const Scatter s)
{
#ifdef SUN
    return s.texel == SUN_TEXEL;
#else
    return 0;
#endif
}

#ifdef SAMPLES_VIRTUAL_LIGHTS
// Return a direction from x with normal n towards a light without geometry, whose f cos is still to be multiplied by
// `weight`: 0 if none shines there. u in [0, 1)^3.
static inline Scatter at_virtual_light(const VirtualLights lights, float3 x, float3 n, float3 u, float *weight)
{
    const LightSample light = sample_virtual_light(lights, x, n, u.xy, u.z);
    Scatter s = no_scatter(light.wi);
    *weight = light.weight;
    if (light.light >= 0) {
        s.texel = LIGHT_TEXEL + light.light;
        s.light_away = light.distance;
    }
    return s;
}
#endif

// Return 1 / density of the hit of a ray; 0 if the ray was aimed at a light and met something else.
static inline float inverse_density(const World world, const Scatter s, const RealHit hit)
{
    float density = s.density;
    if (!(density > 0.0f))
        return 1.0f;
#ifdef SUN
    const float sun = s.sun_share > 0.0f && leaves_room(world.real, hit) ? sun_density(world.real.sun, s.wi) : 0.0f;
    density += s.sun_share * sun;
    if (is_at_sun(s) && !(sun > 0.0f))
        return 0.0f;
#endif
    if (s.light_share > 0.0f) {
        const float light = light_density(world.lights, world.real, hit, s.wi);
        // Points that light sampling cannot reach are left to the other techniques alone. At points it can
        // reach, the texel and its plane determine the one point that was aimed at.
        if (is_aimed(s) && !is_at_sun(s) && !(light > 0.0f && hit.texel == s.texel))
            return 0.0f;
        density += s.light_share * light;
    }
    return 1.0f / density;
}
