// The visible virtual layer of the view: from rasterized texels to the planes that passes read.
//
// in   front     [H*W]     geometry: world normal, radial distance; 0: nothing
//      material  [H*W]     albedo, 1 + material index
//      coverage  [H*W]     fraction of the pixel where an object is in front
//      motion    [H*W]     previous image point, pixels
//      materials           material table (lib/world/brdf.h)
// out  normal 3, depth 1 (0: not visible), id 1 (1 + material index), roughness 1 (GGX alpha; 1:
//      diffuse), albedo 3, coverage 1, motion 2 planes
//
// Normals are turned towards the viewer: interpolated ones may face away near silhouettes.
#include "world/brdf.h"
#include "gbuffer/planes.h"
#include "gbuffer/view.h"

__kernel void unpack_objects(
    const int width,
    const int height,
    __global const float *restrict view,
    __global const float4 *restrict front,
    __global const float4 *restrict material,
    __global const float *restrict coverage_in,
    __global const float2 *restrict motion_in,
    __global const float4 *restrict materials,
    __global float *restrict normal,
    __global float *restrict depth,
    __global float *restrict id,
    __global float *restrict roughness,
    __global float *restrict albedo,
    __global float *restrict coverage,
    __global float *restrict motion)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int texel = y * width + x;
    const int pixel = plane_index(x, y, width), size = plane_size(width, height);
    const float covered = coverage_in[texel];
    const int visible = covered > 0.0f;
    const float4 geometry = visible ? front[texel] : (float4)(0.0f);
    const float4 surface = visible ? material[texel] : (float4)(0.0f);
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
    motion[pixel] = visible ? motion_in[texel].x : -1e9f;
    motion[size + pixel] = visible ? motion_in[texel].y : -1e9f;
}
