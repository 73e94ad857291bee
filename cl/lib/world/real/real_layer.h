// The real layer of a view, of which a pixel shows a panorama texel's surface: what view/resample.cl and
// view/sharpen.cl, which goes on where -D EDGES is given, have in common.
#ifndef IPRT_REAL_LAYER_H
#define IPRT_REAL_LAYER_H

#ifdef GLOSS
#include "world/brdf.h"
#endif
#include "gbuffer/camera.h"
#include "gbuffer/planes.h"
#include "world/real/edges.h"

#ifdef CLIPPED
#define CLIPPED_PARAMETERS                                                                         \
    __global const uint *restrict panorama_clipped,                                                \
        __global const float *restrict panorama_clipped_color,
#define SHOWN {panorama_color, panorama_clipped, panorama_clipped_color}
#else
#define CLIPPED_PARAMETERS
#define SHOWN {panorama_color, 0, 0}
#endif
#ifdef EDGES
#define EDGES_PARAMETER , __global int *restrict other_pixel
#else
#define EDGES_PARAMETER
#endif
#ifdef GLOSS
#define GLOSS_PARAMETERS                                                                           \
    , __global const int *restrict panorama_gloss, __global const float *restrict panorama_highlight, \
        __global const float4 *restrict real_materials, __global float *restrict gloss,            \
        __global float *restrict roughness, __global float *restrict highlight
#else
#define GLOSS_PARAMETERS
#endif

// Panorama: three floats a texel of color and highlight; clipped of lib/world/real/panorama.h.
#define REAL_LAYER_PARAMETERS                                                                      \
    const int width, const int height, __global const float *restrict view,                        \
        __global const float *restrict previous, const int panorama_width,                         \
        const int panorama_height, __global const float *restrict panorama_color,                  \
        CLIPPED_PARAMETERS __global const float4 *restrict panorama_surface,                       \
        __global const float2 *restrict panorama_range, __global float *restrict color,            \
        __global float *restrict normal, __global float *restrict depth,                           \
        __global float *restrict id, __global float *restrict motion EDGES_PARAMETER               \
            GLOSS_PARAMETERS CAMERA_PARAMETER

// What a pixel shows of a texel's plane in direction v, which may leave the texel's depths by a share `slack` of
// them. Scalars only: PoCL vectorizes resample.cl.
static inline ALWAYS_INLINE void show_surface(
    int texel, float3 v, float slack, __global const float *restrict previous,
    __global const float4 *restrict panorama_surface, __global const float2 *restrict panorama_range,
    int pixel, int size, __global float *restrict normal, __global float *restrict depth,
    __global float *restrict id, __global float *restrict motion CAMERA_PARAMETER)
{
    __global const float *restrict surface = (__global const float *)panorama_surface + 4 * texel;
    const float gx = surface[0], gy = surface[1], gz = surface[2];
    const int flags = (int)surface[3];
    const int visible = !(flags & SURFACE_NONE);
    const float facing = visible ? -1.0f / sqrt(gx * gx + gy * gy + gz * gz) : 0.0f;
    normal[pixel] = facing * gx;
    normal[size + pixel] = facing * gy;
    normal[2 * size + pixel] = facing * gz;
    __global const float *restrict near_far = (__global const float *)panorama_range + 2 * texel;
    const float2 range = (float2)((1.0f - slack) * near_far[0], (1.0f + slack) * near_far[1]);
    const float inverse = gx * v.x + gy * v.y + gz * v.z;
    const float radius = visible ? surface_radius(0.0f, inverse, 1.0f, 1.0f, range) : 0.0f;
    depth[pixel] = radius;
    id[pixel] = visible && !(flags & SURFACE_OPENING) ? 1.0f : 0.0f;
#ifdef CAMERA_MOTION
    // Only the direction of distant surfaces matters.
    const float3 point = camera_before(camera, v, radius > 0.0f ? 1.0f / radius : 0.0f);
#else
    const float3 point = v; // the capture centre stays, so only the direction matters
#endif
    const float2 before = view_project(previous, point);
    motion[pixel] = before.x;
    motion[size + pixel] = before.y;
}

#ifdef GLOSS
// What a pixel shows of a texel's gloss: `index` of the real material + 1, and the highlight's radiance.
static inline ALWAYS_INLINE void show_gloss(
    int index, float3 specular, __global const float4 *restrict real_materials, int pixel, int size,
    __global float *restrict gloss, __global float *restrict roughness,
    __global float *restrict highlight)
{
    const Material material = load_material(real_materials, max(index - 1, 0));
    const int all = material.kind == KIND_CONDUCTOR;
    gloss[pixel] = index;
    roughness[pixel] = index ? material.alpha : 0.0f;
    highlight[pixel] = index ? (all ? INFINITY : specular.x) : 0.0f;
    highlight[size + pixel] = index ? (all ? INFINITY : specular.y) : 0.0f;
    highlight[2 * size + pixel] = index ? (all ? INFINITY : specular.z) : 0.0f;
}
#endif

#endif
