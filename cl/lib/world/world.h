// The mixed scene: the real layer, objects and lights; and the radiance of the real scene, as the panorama
// shows it.
//
// Real surfaces are diffuse emitters (IPRT, "Interactive panoramic ray tracing"): the panorama already
// holds every bounce between them.
// -D RELIT multiplies real radiance by the change due to objects (UpdateGbuffer): from the view where it
// shows the surface, else from the panorama. Without either (null pointers) radiance is as captured.
// With a picture of the surroundings, windows show distant radiance in the ray's direction rather than the
// radiance of the point where the ray crosses them.
#pragma once

#include "maths/kernel_attributes.h"
#include "world/real/lights.h"
#include "world/real/panorama.h"
#include "world/objects/lamps.h"
#include "world/objects/objects.h"
#include "world/objects/virtual_lights.h"
#include "world/real/real.h"
#include "world/real/sun.h"
#include <iprt.world.world>
#include "maths/kernel_attributes.h"
#include "gbuffer/view.h"

static inline float3 sky_radiance(const RealLayer real, float3 d)
{
    return equirect_bilinear(real.color, 3, real.grid.width, real.grid.height, real.grid.size, equirect_uv(d));
}

// Return the factor at a surface point in direction d from the capture centre.
static inline float3 relit_towards(const Relit relit, float3 d)
{
    const float2 p = view_project(relit.view, d);
    if (p.x >= 0.0f && p.y >= 0.0f && p.x < relit.size.x && p.y < relit.size.y)
        return relit.screen[(int)p.y * relit.width + (int)p.x].xyz;
    if (!relit.panorama)
        return (float3)(1.0f);
    return equirect_bilinear((__global const float *)relit.panorama, 4, 2 * relit.rows, relit.rows,
                             relit.panorama_size, equirect_uv(d));
}

#define SEEN_IN_FRAME 0     // pictures that hold the radiance of hits: of the frame
#define SEEN_BEHIND 1       // of its background
#define SEEN_OUTSIDE 2      // of the surroundings behind windows

// Return the picture with the radiance without objects of a hit of a ray in direction d, and where.
static inline ALWAYS_INLINE int radiance_picture(const RealLayer real, const RealHit hit, float3 d, float2 *uv)
{
    int picture = SEEN_IN_FRAME;
    *uv = equirect_uv(hit.direction);
    __global const float4 *surfaces = real.surface;
    if (hit.behind) {
        picture = SEEN_BEHIND;
        surfaces = real.background.surface;
    }
    const int surface = hit.kind <= HIT_BACK_FACE;
    if (real.outside && surface && (int)surfaces[hit.texel].w & SURFACE_OPENING) {
        // Behind windows: as the camera saw it in that direction, else extrapolated.
        *uv = equirect_uv(d);
        const int texel = sized_texel(*uv, real.grid.width, real.grid.height, real.grid.size);
        if (real.background.surface) {
            picture = SEEN_BEHIND;
            surfaces = real.background.surface;
        }
        if (!((int)surfaces[texel].w & SURFACE_OPENING))
            picture = SEEN_OUTSIDE;
    }
    return picture;
}

// Return the radiance at uv of such a picture, by one lookup.
static inline ALWAYS_INLINE float3 picture_radiance(const RealLayer real, int picture, float2 uv)
{
    const int outside = picture == SEEN_OUTSIDE;
    return equirect_bilinear(outside                      ? real.outside
                                 : picture == SEEN_BEHIND ? real.background.color
                                                          : real.color,
                             3, outside ? 2 * OUTSIDE_ROWS : real.grid.width,
                             outside ? OUTSIDE_ROWS : real.grid.height,
                             outside ? (float2)(2.0f * OUTSIDE_ROWS, OUTSIDE_ROWS) : real.grid.size, uv);
}

// Return the radiance without objects of a hit of a ray in direction d, as the panorama shows it.
static inline ALWAYS_INLINE float3 pictured_radiance(const RealLayer real, const RealHit hit, float3 d)
{
#ifdef IMPOSTOR
    return impostor_radiance(real.impostor, hit.direction);
#else
    float2 uv;
    const int picture = radiance_picture(real, hit, d, &uv);
    return picture_radiance(real, picture, uv);
#endif
}

// Return the same with the sun, which the panorama does not show.
static inline ALWAYS_INLINE float3 captured_radiance(const RealLayer real, const RealHit hit, float3 d)
{
    float3 radiance = pictured_radiance(real, hit, d);
#ifdef SUN
    if (sun_density(real.sun, d) > 0.0f && leaves_room(real, hit))
        radiance += real.sun.radiance.xyz;
#endif
    return radiance;
}

// Last kind of hit whose factor is known. The back of a surface gets the factor of its front, which is better than none
// for shadows. A lamp on a table does not light the board from below.
#ifdef ADDED_LIGHT
#define LAST_RELIT HIT_SURFACE
#else
#define LAST_RELIT HIT_BACK_FACE
#endif

// Return the factor by which objects change the radiance of a hit. It is unknown, and 1, on surfaces that the
// view does not show.
static inline float3 relit_factor(const World world, const RealHit hit)
{
    const int known = world.relit.screen && hit.kind <= LAST_RELIT && !hit.behind;
    return known ? relit_towards(world.relit, hit.direction) : (float3)(1.0f);
}
