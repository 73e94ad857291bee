// The visible virtual layer of the view: from rasterized texels to the planes that passes read.
//
// in   display   [3*H*W]   three images: world normal, radial distance (0: nothing); albedo,
//                          1 + material index; fraction of the pixel where an object is in front,
//                          previous image point in pixels
//      materials           material table (lib/world/brdf.h)
// out  normal 3, depth 1 (0: not visible), id 1 (1 + material index), roughness 1 (GGX alpha; 1:
//      diffuse), albedo 3, coverage 1, motion 2 planes
//
// It runs over a rectangle; outside, nothing is written. Normals are turned towards the viewer:
// interpolated ones may face away near silhouettes.
#include "world/brdf.h"
#include "gbuffer/planes.h"
#include "gbuffer/view.h"

__kernel void unpack_objects(
    const int4 rectangle,                        // x0, y0, x1, y1
    const int width,
    const int height,
    __global const float *restrict view,
    __global const float4 *restrict display,
    __global const float4 *restrict materials,
    __global float *restrict normal,
    __global float *restrict depth,
    __global float *restrict id,
    __global float *restrict roughness,
    __global float *restrict albedo,
    __global float *restrict coverage,
    __global float *restrict motion)
{
    const int x = rectangle.x + (int)get_global_id(0), y = rectangle.y + (int)get_global_id(1);
    if (x >= rectangle.z || y >= rectangle.w)
        return;
    const int texel = y * width + x;
    const int pixel = plane_index(x, y, width), size = plane_size(width, height);
    const float4 shown = display[2 * width * height + texel];
    const float covered = shown.x;
    const int visible = covered > 0.0f;
    const float4 geometry = visible ? display[texel] : (float4)(0.0f);
    const float4 surface = visible ? display[width * height + texel] : (float4)(0.0f);
    const float3 v = view_direction(view, (float2)(x + 0.5f, y + 0.5f));
    const float away = fmax(dot(geometry.xyz, v), 0.0f);
    const float3 n = visible ? normalize(geometry.xyz - (away + away) * v) : (float3)(0.0f);
    normal[pixel] = n.x;
    normal[size + pixel] = n.y;
    normal[2 * size + pixel] = n.z;
    depth[pixel] = geometry.w;
    id[pixel] = surface.w;
    const Material parameters = load_material(materials, max((int)surface.w - 1, 0));
    roughness[pixel] = parameters.kind == KIND_DIFFUSE ? 1.0f : parameters.alpha;
    albedo[pixel] = surface.x;
    albedo[size + pixel] = surface.y;
    albedo[2 * size + pixel] = surface.z;
    coverage[pixel] = covered;
    motion[pixel] = visible ? shown.y : -1e9f;
    motion[size + pixel] = visible ? shown.z : -1e9f;
}
