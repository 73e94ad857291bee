// Unpacks the visible object layer of the view from rasterized texels into planes for later passes.
//
// in   display             lib/gbuffer/display.h
//      materials           material table (lib/world/brdf.h)
//      real_normal 3, real_depth 1 plane, other and other_pixel [H*W]: the real layer (compositing/real_layer.cl)
// out  normal 3, depth 1 (0: not visible), id 1 (1 + material index), roughness 1 (GGX alpha; 1:
//      diffuse), albedo 3, coverage 1, motion 2 planes; metallic 1, null without principled materials; coat_normal 2,
//      null if no clearcoat has a normal of its own (lib/world/finish.h); variant 1, null without variants: as id, but
//      of the variant; filters see one surface
//      sides     [H*W]     shares of the pixel's own real surface, and of the other one, that objects hide,
//                          where other_pixel is not -1 and objects are in the pixel
//
// Depth edges of the real layer are sharper than the texels that objects were compared with. A pixel at an
// edge therefore compares them with the surfaces on both sides, weighted by area.
//
// Runs over a rectangle and writes nothing outside. Normals are turned towards the viewer: interpolated ones
// may face away near silhouettes.
#include "world/material.h"
#include "gbuffer/display.h"
#include "gbuffer/planes.h"
#include "gbuffer/view.h"

#define ACROSS 4         // samples along a pixel's side
#define PLANE_RANGE 0.1f // largest relative change of distance: unbounded for planes seen edge-on

// Return a normal turned towards the viewer, from whom v comes.
static inline float3 turned(float3 normal, float3 v)
{
    const float away = fmax(dot(normal, v), 0.0f);
    return normalize(normal - (away + away) * v);
}

// Return the plane of a surface that a pixel shows in direction `at`: xyz = g, g . x = 1 on it; w: 1 /
// distance. All 0: open sky.
static inline float4 facet(float3 normal, float distance, float3 at)
{
    const float nearness = distance > 0.0f ? 1.0f / distance : 0.0f;
    return (float4)(nearness / fmin(dot(normal, at), -1e-6f) * normal, nearness);
}

static inline float nearness_along(float4 facet, float3 v)
{
    return clamp(dot(facet.xyz, v), (1.0f - PLANE_RANGE) * facet.w, (1.0f + PLANE_RANGE) * facet.w);
}

static inline float4 real_facet(__global const float *restrict real_normal,
                                __global const float *restrict real_depth,
                                __global const float *restrict view, int2 at, int width, int size)
{
    const int pixel = plane_index(at.x, at.y, width);
    return facet(load_planes(real_normal, size, pixel), real_depth[pixel],
                 view_direction(view, convert_float2(at) + 0.5f));
}

// Return the fractions of a pixel in which the object is in front of each of two surfaces.
static inline float2 in_front_of_sides(
    float4 object, float4 own, float4 other, __global const float *restrict view, int2 at)
{
    int2 in_front = (int2)(0);
    for (int i = 0; i < ACROSS * ACROSS; i++) {
        const float2 within = ((float2)(i % ACROSS, i / ACROSS) + 0.5f) / ACROSS;
        const float3 v = view_direction(view, convert_float2(at) + within);
        const float limit = (1.0f + COVERAGE_TOLERANCE) * nearness_along(object, v);
        in_front.x += nearness_along(own, v) <= limit;
        in_front.y += nearness_along(other, v) <= limit;
    }
    return convert_float2(in_front) / (float)(ACROSS * ACROSS);
}

__kernel void unpack_objects(
    const int4 rectangle,                        // x0, y0, x1, y1
    const int width,
    const int height,
    __global const float *restrict view,
    __global const float4 *restrict display,
    __global const float4 *restrict materials,
    __global const float *restrict real_normal,
    __global const float *restrict real_depth,
    __global const float4 *restrict other,
    __global const int *restrict other_pixel,
    __global float *restrict normal,
    __global float *restrict depth,
    __global float *restrict id,
    __global float *restrict variant,
    __global float *restrict roughness,
    __global float *restrict metallic,
    __global float *restrict coat_normal,
    __global float *restrict emission,
    __global float *restrict albedo,
    __global float *restrict coverage,
    __global float2 *restrict sides,
    __global float *restrict motion)
{
    const int x = rectangle.x + (int)get_global_id(0), y = rectangle.y + (int)get_global_id(1);
    if (x >= rectangle.z || y >= rectangle.w)
        return;
    const int texel = y * width + x;
    const int pixel = plane_index(x, y, width), size = plane_size(width, height);
    __global const float4 *image = display + texel;
    const float4 shown = image[DISPLAY_COVERAGE * width * height];
    const float3 v = view_direction(view, (float2)(x + 0.5f, y + 0.5f));
    const float4 seen = image[DISPLAY_NORMAL * width * height];
    const float3 towards = turned(seen.xyz, v);
    float covered = shown.x;
    const int second = other_pixel[texel];
    if (second >= 0 && shown.w > 0.0f) {
        const int2 at = (int2)(x, y), beyond = (int2)(second % width, second / width);
        const float4 own = real_facet(real_normal, real_depth, view, at, width, size);
        const float4 theirs = real_facet(real_normal, real_depth, view, beyond, width, size);
        const float4 object = facet(towards, seen.w, v);
        const float2 hidden = shown.w * in_front_of_sides(object, own, theirs, view, at);
        sides[texel] = hidden;
        covered = mix(hidden.x, hidden.y, other[texel].w);
    }
    const int visible = covered > 0.0f;
    const float3 n = visible ? towards : (float3)(0.0f);
    const float4 surface = visible ? image[DISPLAY_MATERIAL * width * height] : (float4)(0.0f);
    normal[pixel] = n.x;
    normal[size + pixel] = n.y;
    normal[2 * size + pixel] = n.z;
    depth[pixel] = visible ? seen.w : 0.0f;
    id[pixel] = surface.w;
    if (variant) {
        variant[pixel] = surface.w;
        id[pixel] = visible ? without_variant(materials, (int)surface.w - 1) + 1 : 0.0f;
    }
    const Material parameters = load_material(materials, max((int)surface.w - 1, 0));
    roughness[pixel] = parameters.kind == KIND_DIFFUSE ? 1.0f : parameters.alpha;
    if (metallic) {
        const float4 finish = image[DISPLAY_FINISH * width * height];
        metallic[pixel] = visible && parameters.kind == KIND_PRINCIPLED ? finish.x : 0.0f;
        roughness[pixel] = visible && parameters.kind == KIND_PRINCIPLED ? finish.y : roughness[pixel];
    }
    if (coat_normal && visible) {
        const float2 stored = image[DISPLAY_FINISH * width * height].zw;
        const float3 own = frame_to_world(build_frame(seen.xyz), unpacked_coat_normal(stored));
        const float2 packed = packed_coat_normal(n, turned(own, v));
        coat_normal[pixel] = packed.x;
        coat_normal[size + pixel] = packed.y;
    }
    if (emission)
        store_planes(emission, size, pixel, visible ? image[DISPLAY_EMISSION * width * height].xyz : (float3)(0.0f));
    albedo[pixel] = surface.x;
    albedo[size + pixel] = surface.y;
    albedo[2 * size + pixel] = surface.z;
    coverage[pixel] = covered;
    motion[pixel] = visible ? shown.y : -1e9f;
    motion[size + pixel] = visible ? shown.z : -1e9f;
}
