// Directions in which surfaces send rays, and the densities with which these were chosen.
//
// A share of the rays is aimed at the bright parts of the panorama; the densities of both ways to
// choose a direction are mixed (one-sample balance heuristic: Veach and Guibas,
// "Optimally Combining Sampling Techniques for Monte Carlo Rendering", SIGGRAPH 1995).
#ifndef IPRT_DIRECTION_H
#define IPRT_DIRECTION_H

#include "world/world.h"

// A direction in which a surface passes light on, and what its density was.
typedef struct {
    float3 wi;
    float diffuse;        // f cos, without the albedo
    float3 specular;      // f cos
    float density;        // with which wi was chosen, but for light sampling; 0: a perfect mirror's,
                          // whose f cos holds the density already
    float light_share;    // probability of aiming at lights instead
    int aimed;            // at a light: nothing else counts
    int texel;            // of that light
} Scatter;

static inline Scatter no_scatter(float3 wi)
{
    Scatter s;
    s.wi = wi;
    s.diffuse = 0.0f;
    s.specular = (float3)(0.0f);
    s.density = s.light_share = 0.0f;
    s.aimed = s.texel = 0;
    return s;
}

// 1 / density of what a ray from o met: 0 if it was aimed at a light and met something else.
static inline float inverse_density(const World world, const Scatter s, float3 o, const RealHit hit)
{
    float density = s.density;
    if (!(density > 0.0f))
        return 1.0f;
    if (s.light_share > 0.0f) {
        const float light = light_density(world.lights, world.real, hit, o, s.wi);
        // What has no density of light sampling is for the other ways to bring in, alone. Where it has
        // one, the texel and its plane leave no point but the one that was aimed at.
        if (s.aimed && !(light > 0.0f && hit.texel == s.texel))
            return 0.0f;
        density += s.light_share * light;
    }
    return 1.0f / density;
}

#endif
