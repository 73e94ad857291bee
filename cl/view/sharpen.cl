// Depth edges of the real layer at the view's resolution (world/real/edges.h).
//
// in       view       [16]      lib/gbuffer/view.h
//          previous   [16]      view of the previous picture
//          panorama   as in resample.cl
// in, out  planes that resample.cl has filled: where a gap is near, pixels show one side or, on the edge,
//          both by coverage; depth, normal, id and motion are those of the side that covers more
//          other      1 plane   in, 1: a texel around the pixel is at a gap; out: share of the other side in
//                               the radiance, in [0, 1)
// out      other_pixel [H*W]    a pixel (y * width + x) that shows that side, where it has a share
#ifdef GLOSS
#include "world/brdf.h"
#endif
#include "gbuffer/camera.h"
#include "gbuffer/planes.h"
#include "world/real/edges.h"

__kernel void sharpen_edges(
    const int width,
    const int height,
    __global const float *restrict view,
#ifdef CAMERA_MOTION
    __global const float *restrict previous,
#endif
    const int panorama_width,
    const int panorama_height,
    __global const float *restrict panorama_color,      // 3 a texel
#ifdef CLIPPED
    __global const uint *restrict panorama_clipped,     // lib/world/real/panorama.h
    __global const float *restrict panorama_clipped_color,
#endif
    __global const float4 *restrict panorama_surface,
    __global const float2 *restrict panorama_range,
    __global float *restrict other,
    __global int *restrict other_pixel,
    __global float *restrict color,
    __global float *restrict normal,
    __global float *restrict depth,
    __global float *restrict id
#ifdef CAMERA_MOTION
    ,
    __global float *restrict motion
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
    if (!(other[pixel] > 0.0f))
        return;
    other[pixel] = 0.0f;
    const Footprint inside = footprint(view, x, y);
    Window window = window_at(panorama_width, panorama_height, inside.middle);
    const Joints joints = window_joints(panorama_surface, &window);
    const int2 found = sides_of_gap(&window, joints);
    if (INNER & ~(found.x | found.y))
        return;
    // Which of both is in front does not matter: each could be called so.
    const int front = found.x, back = found.y;
#ifdef CLIPPED
    const Shown shown = {panorama_color, panorama_clipped, panorama_clipped_color};
#else
    const Shown shown = {panorama_color, 0, 0};
#endif
    see(&window, shown);
    const int2 pure = pure_texels(&window, front, back, joints.mixed);
    if (!pure.x)
        return;
    float mixtures;
    const float16 coverage = find_coverage(&window, front, pure, joints.mixed, &mixtures);
    const float2 texels = (float2)(panorama_width, panorama_height);
    const float share
        = pixel_coverage(&window, coverage, inside.right * texels, inside.down * texels);
    const int2 whole = whole_texels(front, back, pure, coverage);
    const float3 front_color = side_color(&window, whole.x);
    const float3 back_color = side_color(&window, whole.y);
    const float3 blurred = load_planes(color, size, pixel);
    store_planes(color, size, pixel, mix(blurred, mix(back_color, front_color, share), mixtures));

    const int in_front = share > 0.5f;
    const float of_front = mix(blurred_coverage(&window, coverage), share, mixtures);
    const float of_other = in_front ? 1.0f - of_front : of_front;
    const float3 other_color = of_other * (in_front ? back_color : front_color);
    const float3 own_color = (1.0f - of_other) * (in_front ? front_color : back_color);
    const int beyond = nearest_texel(&window, in_front ? whole.y : whole.x);
    const float2 there = view_project(view, texel_direction(beyond % panorama_width,
                                                            beyond / panorama_width,
                                                            panorama_width, panorama_height));
    if (there.x >= 0.0f && there.y >= 0.0f && there.x < width && there.y < height) {
        other_pixel[y * width + x] = (int)there.y * width + (int)there.x;
        other[pixel] =
            luminance(other_color) / fmax(luminance(own_color) + luminance(other_color), FLT_MIN);
    }

    const int texel = nearest_texel(&window, in_front ? front : back);
    const float4 surface = panorama_surface[texel];
    const int flags = (int)surface.w, visible = !(flags & SURFACE_NONE);
    store_planes(normal, size, pixel,
                 surface.xyz * (visible ? -1.0f / length(surface.xyz) : 0.0f));
    // The plane goes on beyond its texel.
    const float2 range = panorama_range[texel] * (float2)(0.9f, 1.1f);
    const float radius = visible
        ? surface_radius(0.0f, dot(surface.xyz, inside.direction), 1.0f, 1.0f, range)
        : 0.0f;
    depth[pixel] = radius;
    id[pixel] = visible && !(flags & SURFACE_OPENING) ? 1.0f : 0.0f;
#ifdef CAMERA_MOTION
    const float2 before = view_project(
        previous, camera_before(camera, inside.direction, radius > 0.0f ? 1.0f / radius : 0.0f));
    motion[pixel] = before.x;
    motion[size + pixel] = before.y;
#endif
#ifdef GLOSS
    const int index = panorama_gloss[texel];
    const Material material = load_material(real_materials, max(index - 1, 0));
    const int all = material.kind == KIND_CONDUCTOR;
    float3 specular = (float3)(index && all ? INFINITY : 0.0f);
    if (index && !all) {
        const Shown part = {panorama_highlight, 0, 0};
        see(&window, part);
        specular = mix(shown_in_pixel(part, panorama_width, panorama_height, inside, 1),
                       mix(side_color(&window, whole.y), side_color(&window, whole.x), share),
                       mixtures);
    }
    gloss[pixel] = index;
    roughness[pixel] = index ? material.alpha : 0.0f;
    store_planes(highlight, size, pixel, specular);
#endif
}
