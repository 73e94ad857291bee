// The mixed scene: the real layer, objects and lights; and the radiance of the real scene, as the panorama
// shows it.
//
// Real surfaces are diffuse emitters (IPRT, "Interactive panoramic ray tracing"): the panorama already
// holds every bounce between them.
// -D RELIT multiplies real radiance by the change due to objects (UpdateGbuffer): from the view where it
// shows the surface, else from the panorama. Without either (null pointers) radiance is as captured.
// With a picture of the surroundings, windows show distant radiance in the ray's direction rather than the
// radiance of the point where the ray crosses them.
#ifndef IPRT_WORLD_H
#define IPRT_WORLD_H

#include "world/real/lights.h"
#include "world/real/panorama.h"
#include "world/scene.h"
#include "maths/tracing.h"
#include "gbuffer/view.h"

#ifdef RELIT
// Factors by which objects change the radiance of real surfaces.
typedef struct {
    __global const float4 *screen;      // per pixel of the view, [width * height], or null
    __global const float *view;         // of `screen`: lib/gbuffer/view.h
    int width;
    int height;
    __global const float4 *panorama;    // [rows * 2 rows], equirect, or null
    int rows;
} Relit;
#endif

// Glossy real surfaces.
typedef struct {
    __global const int *map;              // per texel: 0 diffuse, else 1 + index of the material
    __global const float4 *materials;       // lib/world/brdf.h
    __global const float4 *reflectance;     // per material: reflectance of conductors
    __global const float4 *gain;            // per cell: gain of highlights (lib/world/real/gloss.h)
    int columns;                            // cells
    int rows;
} Gloss;

typedef struct {
    RealLayer real;
    __global const float *color;        // panorama radiance, 3 a texel
    Objects objects;
    __global const float4 *materials;   // lib/world/brdf.h
    int max_bounces;                    // virtual surfaces that a path may meet
    __global const float *outside;      // 3 a texel, [OUTSIDE_ROWS * 2 OUTSIDE_ROWS], seen through
                                        // windows, or null
    Lights lights;
#ifdef RELIT
    Relit relit;
#endif
#ifdef GLOSS
    Gloss gloss;
#endif
} World;

#ifdef RELIT
#define RELIT_PARAMETERS                                                                           \
    , __global const float4 *restrict relit_screen, __global const float *restrict relit_view,     \
        const int relit_width, const int relit_height,                                             \
        __global const float4 *restrict relit_panorama, const int relit_rows
#define WORLD_RELIT                                                                                \
    , {relit_screen, relit_view, relit_width, relit_height, relit_panorama, relit_rows}
#else
#define RELIT_PARAMETERS
#define WORLD_RELIT
#endif

#ifdef GLOSS
#define GLOSS_PARAMETERS                                                                           \
    , __global const int *restrict real_gloss, __global const float4 *restrict real_materials,   \
        __global const float4 *restrict real_reflectance,                                          \
        __global const float4 *restrict real_gain, const int gain_columns, const int gain_rows
#define WORLD_GLOSS                                                                                \
    , {real_gloss, real_materials, real_reflectance, real_gain, gain_columns, gain_rows}
#else
#define GLOSS_PARAMETERS
#define WORLD_GLOSS
#endif

// Parameters of every kernel that traces paths: `World.arguments` of iprt/world/world.py.
#define WORLD_PARAMETERS                                                                           \
    REAL_PARAMETERS, OBJECT_PARAMETERS, __global const float4 *restrict materials,                 \
        const int max_bounces, LIGHT_PARAMETERS RELIT_PARAMETERS GLOSS_PARAMETERS

#define WORLD(view)                                                                                \
    {                                                                                              \
        REAL_LAYER, real_color, OBJECTS(view), materials, max_bounces, real_outside,               \
            LIGHTS WORLD_RELIT WORLD_GLOSS                                                         \
    }

static inline float3 sky_radiance(const World world, float3 d)
{
    return panorama_bilinear(world.color, world.real.grid.width, world.real.grid.height,
                             equirect_uv(d));
}

#ifdef RELIT
// Return the factor at a surface point in direction d from the capture centre.
static inline float3 relit_factor(const Relit relit, float3 d)
{
    const float2 p = view_project(relit.view, d);
    if (p.x >= 0.0f && p.y >= 0.0f && p.x < relit.width && p.y < relit.height)
        return relit.screen[(int)p.y * relit.width + (int)p.x].xyz;
    if (!relit.panorama)
        return (float3)(1.0f);
    return equirect_bilinear((__global const float *)relit.panorama, 4, 2 * relit.rows, relit.rows,
                             equirect_uv(d));
}
#endif

// Return the radiance without objects of a hit of a ray in direction d, by one lookup in one picture.
static inline float3 captured_radiance(const World world, const RealHit hit, float3 d)
{
#ifdef IMPOSTOR
    return impostor_radiance(world.real.impostor, hit.direction);
#else
    __global const float *picture = world.color;
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
    if (world.outside && surface && (int)surfaces[hit.texel].w & SURFACE_OPENING) {
        // Behind windows: as the camera saw it in that direction, else extrapolated.
        uv = equirect_uv(d);
        const int texel = equirect_texel(uv, width, height);
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
    return panorama_bilinear(picture, width, height, uv);
#endif
}

// Return the same radiance, changed by objects.
static inline float3 real_radiance(const World world, const RealHit hit, float3 d)
{
    float3 radiance = captured_radiance(world, hit, d);
#ifdef RELIT
    int known = world.relit.screen && hit.kind <= HIT_BACK_FACE;
#ifdef BACKGROUND
    // The change is unknown on surfaces that the view does not show.
    known &= !hit.behind;
#endif
    if (known)
        radiance *= relit_factor(world.relit, hit.direction);
#endif
    return radiance;
}

#endif
