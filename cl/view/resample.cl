// The real layer of the view, resampled from the panorama: what the camera shows without objects.
//
// in   view       [16]       lib/gbuffer/view.h
//      previous   [16]       view of the previous picture
//      panorama   lib/world/real/real.h surface, range; color; -D CLIPPED: what of it was clipped
// out  color      3 planes   linear radiance, L_cam of IPRT Eq. 2 (reconstruct.h); the panorama's own bits
//                            in an equirect view of its size
//      normal     3 planes   world, facing the capture centre
//      depth      1 plane    metres from the capture centre; 0: open sky
//      id         1 plane    1: surface that takes shadows; 0: opening or open sky
//      motion     2 planes   where the point was in the previous picture, pixels; -1e9: nowhere
// and with -D EDGES
//      other      1 plane    1: one of the four texels around is at a gap, and the view is about as fine as
//                            the panorama, or finer: sharpen.cl goes on; else 0
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
#include "gbuffer/planes.h"
#include "world/real/edges.h"

__kernel void resample_panorama(
    const int width,
    const int height,
    __global const float *restrict view,
    __global const float *restrict previous,
    const int panorama_width,
    const int panorama_height,
    __global const float *restrict panorama_color,      // 3 a texel
#ifdef CLIPPED
    __global const uint *restrict panorama_clipped,     // lib/world/real/panorama.h
    __global const float *restrict panorama_clipped_color,
#endif
    __global const float4 *restrict panorama_surface,
    __global const float2 *restrict panorama_range,
    __global float *restrict color,
    __global float *restrict normal,
    __global float *restrict depth,
    __global float *restrict id,
    __global float *restrict motion
#ifdef EDGES
    ,
    __global float *restrict other
#endif
#ifdef GLOSS
    ,
    __global const int *restrict panorama_gloss,
    __global const float *restrict panorama_highlight,   // 3 a texel
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
    const Footprint inside = footprint(view, x, y);
    const float3 v = inside.direction;
    const float2 uv = inside.middle;
    int texel = min((int)(uv.y * panorama_height), panorama_height - 1) * panorama_width
        + min((int)(uv.x * panorama_width), panorama_width - 1);
#ifdef CLIPPED
    const Shown shown = {panorama_color, panorama_clipped, panorama_clipped_color};
#else
    const Shown shown = {panorama_color, 0, 0};
#endif
    const int points = points_across(view, panorama_height);
    float3 radiance;
#ifdef EDGES
    __global const float *restrict marks = (__global const float *)panorama_surface + 3;
    const Taps around = equirect_taps(panorama_width, panorama_height, uv);
    const int gap = at_gap((int)marks[4 * around.a]) || at_gap((int)marks[4 * around.b])
        || at_gap((int)marks[4 * around.below_a]) || at_gap((int)marks[4 * around.below_b]);
    other[pixel] = gap && points == 1 ? 1.0f : 0.0f;
#endif
#ifdef VIEW_EQUIRECT
    // The panorama at its own size keeps its bits: rounded directions would blend in neighbours.
    if (width == panorama_width && height == panorama_height
        && view[0] == 1.0f && view[4] == 1.0f && view[8] == 1.0f) {
        texel = y * width + x;
        radiance = (float3)(shown_texel(shown, texel, 0), shown_texel(shown, texel, 1),
                            shown_texel(shown, texel, 2));
#ifdef EDGES
        other[pixel] = 0.0f;
#endif
    } else
#endif
        radiance = shown_in_pixel(shown, panorama_width, panorama_height, inside, points);
    color[pixel] = radiance.x;
    color[size + pixel] = radiance.y;
    color[2 * size + pixel] = radiance.z;

    __global const float *restrict surface = (__global const float *)panorama_surface + 4 * texel;
    const float gx = surface[0], gy = surface[1], gz = surface[2];
    const int flags = (int)surface[3];
    const int visible = !(flags & SURFACE_NONE);
    const float facing = visible ? -1.0f / sqrt(gx * gx + gy * gy + gz * gz) : 0.0f;
    normal[pixel] = facing * gx;
    normal[size + pixel] = facing * gy;
    normal[2 * size + pixel] = facing * gz;
    __global const float *restrict near_far = (__global const float *)panorama_range + 2 * texel;
    const float2 range = (float2)(near_far[0], near_far[1]);
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

#ifdef GLOSS
    const int index = panorama_gloss[texel];
    const Material material = load_material(real_materials, max(index - 1, 0));
    const Shown part = {panorama_highlight, 0, 0};
    const float3 specular
        = shown_in_pixel(part, panorama_width, panorama_height, inside, points);
    const int all = material.kind == KIND_CONDUCTOR;
    gloss[pixel] = index;
    roughness[pixel] = index ? material.alpha : 0.0f;
    highlight[pixel] = index ? (all ? INFINITY : specular.x) : 0.0f;
    highlight[size + pixel] = index ? (all ? INFINITY : specular.y) : 0.0f;
    highlight[2 * size + pixel] = index ? (all ? INFINITY : specular.z) : 0.0f;
#endif
}
