// Tangent planes and depth ranges of rasterized object layers, for the marches of
// lib/world/objects/objects.h. -D VIEW_EQUIRECT for equirect layers.
//
// in   view      [16]      lib/gbuffer/view.h
//      geometry  [2][H*W]  front, back: world shading normal, radial distance; 0: no surface
// out  planes    [H*W][2]  front, back: xyz g of the tangent plane g.x = 1, w radial distance
//      range     [H*W]     (smallest front, largest back) radial distance within the texel;
//                          (INFINITY, -INFINITY) where there is no solid
//
// A texel with a front but no back was borrowed from a neighbour for anti-aliasing: not traced.
#include "world/objects/objects.h"

// Planes seen at less than this cosine are tilted towards the viewer.
#define GRAZING 0.05f

static inline float4 object_plane(float4 geometry, float3 v)
{
    float3 n = geometry.xyz;
    float facing = dot(n, v);
    if (fabs(facing) < GRAZING) {
        const float wanted = facing < 0.0f ? -GRAZING : GRAZING;
        n += (wanted - facing) * v;
        facing = wanted;
    }
    return (float4)(n / (facing * geometry.w), geometry.w);
}

__kernel void build_object_surface(
    const int width,
    const int height,
    const float footprint,                       // of a texel, per metre of distance
    __global const float *restrict view,         // projection of the layers
    __global const float4 *restrict geometry,    // two layers
    __global float4 *restrict planes,            // out
    __global float2 *restrict range)             // out
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int texel = y * width + x;
    const float4 front = geometry[texel], back = geometry[width * height + texel];
    if (!(front.w > 0.0f && back.w > 0.0f)) {
        planes[2 * texel] = planes[2 * texel + 1] = (float4)(0.0f);
        range[texel] = (float2)(INFINITY, -INFINITY);
        return;
    }
    const float3 v = view_direction(view, (float2)(x + 0.5f, y + 0.5f));
    const float4 f = object_plane(front, v), b = object_plane(back, v);
    const float slope = OBJECT_SLOPE * footprint;
    float low = f.w, high = b.w;
    for (int corner = 0; corner < 4; corner++) {
        const float3 w = view_direction(view, (float2)(x + (corner & 1), y + (corner >> 1)));
        low = fmin(low, plane_radius(f, dot(f.xyz, w), 1.0f, 1.0f - slope, 1.0f + slope));
        high = fmax(high, plane_radius(b, dot(b.xyz, w), 1.0f, 1.0f - slope, 1.0f + slope));
    }
    planes[2 * texel] = f;
    planes[2 * texel + 1] = b;
    range[texel] = (float2)(low, high);
}
