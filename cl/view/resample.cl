// The real layer of the view, resampled from the panorama: what the camera shows without objects.
//
// in   view       [16]       lib/gbuffer/view.h
//      previous   [16]       view of the previous picture
//      panorama   lib/world/real/real.h surface, range; color
// out  color      3 planes   linear radiance, bilinear: L_cam of IPRT Eq. 2; the panorama's own bits
//                            in an equirect view of its size
//      normal     3 planes   world, facing the capture centre
//      depth      1 plane    metres from the capture centre; 0: open sky
//      id         1 plane    1: surface that takes shadows; 0: opening or open sky
//      motion     2 planes   where the point was in the previous picture, pixels; -1e9: nowhere
// and with -D GLOSS, from the panorama's gloss, highlight and the table of real materials
// (lib/world/brdf.h)
//      gloss      1 plane    0: diffuse, else 1 + index of the real material
//      roughness  1 plane    GGX alpha of that
//      highlight  3 planes   specular part of what the camera saw; infinite where all of it is
// With -D CAMERA_MOTION, `camera` (lib/gbuffer/camera.h) tells where surfaces were; else they stayed.
#ifdef GLOSS
#include "world/brdf.h"
#endif
#include "gbuffer/camera.h"
#include "world/real/panorama.h"
#include "gbuffer/planes.h"
#include "world/real/real.h"
#include "gbuffer/view.h"

__kernel void resample_panorama(
    const int width,
    const int height,
    __global const float *restrict view,
    __global const float *restrict previous,
    const int panorama_width,
    const int panorama_height,
    __global const float4 *restrict panorama_color,
    __global const float4 *restrict panorama_surface,
    __global const float2 *restrict panorama_range,
    __global float *restrict color,
    __global float *restrict normal,
    __global float *restrict depth,
    __global float *restrict id,
    __global float *restrict motion
#ifdef GLOSS
    ,
    __global const uchar *restrict panorama_gloss,
    __global const float4 *restrict panorama_highlight,
    __global const float4 *restrict real_materials,
    __global float *restrict gloss,
    __global float *restrict roughness,
    __global float *restrict highlight
#endif
    CAMERA_PARAMETER)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int pixel = plane_index(x, y, width), size = plane_size(width, height);
    const float3 v = view_direction(view, (float2)(x + 0.5f, y + 0.5f));
    const float2 uv = equirect_uv(v);
    int texel = min((int)(uv.y * panorama_height), panorama_height - 1) * panorama_width
        + min((int)(uv.x * panorama_width), panorama_width - 1);
    float3 radiance = panorama_bilinear(panorama_color, panorama_width, panorama_height, uv);
#ifdef VIEW_EQUIRECT
    // The panorama at its own size keeps its bits: rounded directions would blend in neighbours.
    if (width == panorama_width && height == panorama_height
        && view[0] == 1.0f && view[4] == 1.0f && view[8] == 1.0f) {
        texel = y * width + x;
        radiance = panorama_color[texel].xyz;
    }
#endif
    color[pixel] = radiance.x;
    color[size + pixel] = radiance.y;
    color[2 * size + pixel] = radiance.z;

    const float4 surface = panorama_surface[texel];
    const int flags = (int)surface.w;
    const int visible = !(flags & SURFACE_NONE);
    const float3 n = visible ? -normalize(surface.xyz) : (float3)(0.0f);
    normal[pixel] = n.x;
    normal[size + pixel] = n.y;
    normal[2 * size + pixel] = n.z;
    const float radius = visible
        ? surface_radius(0.0f, dot(surface.xyz, v), 1.0f, 1.0f, panorama_range[texel]) : 0.0f;
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

#ifdef GLOSS
    const int index = panorama_gloss[texel];
    gloss[pixel] = index;
    roughness[pixel] = 0.0f;
    float3 specular = (float3)(0.0f);
    if (index) {
        const Material material = load_material(real_materials, index - 1);
        roughness[pixel] = material.alpha;
        specular = material.kind == KIND_CONDUCTOR
            ? (float3)(INFINITY)
            : panorama_bilinear(panorama_highlight, panorama_width, panorama_height, uv);
    }
    highlight[pixel] = specular.x;
    highlight[size + pixel] = specular.y;
    highlight[2 * size + pixel] = specular.z;
#endif
}
