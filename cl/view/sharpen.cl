// Depth edges of the real layer at the view's resolution (world/real/edges.h).
//
// in       view       [16]      lib/gbuffer/view.h
//          previous   [16]      view of the previous picture
//          panorama             as in resample.cl
// in, out  planes that resample.cl has filled: where a gap is near, pixels show one side or, on the edge,
//          both by coverage; depth, normal, id and motion are those of the side that covers more
//          other_pixel [H*W]    in, not -1: a texel around the pixel is at a gap; out: a pixel (y * width + x)
//                               that shows the other side; the pixel itself: the view shows none; -1: the
//                               pixel is as resample.cl left it
// out      other      [H*W]     xyz: share of the other side in the radiance, w: in the area, each in [0, 1];
//                               where other_pixel is not -1
#include "world/real/real_layer.h"

#define BEYOND 0.1f // of a texel's depth, up to which its plane goes on into its neighbours

__kernel void sharpen_edges(REAL_LAYER_PARAMETERS, __global float4 *restrict other)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int pixel = plane_index(x, y, width), size = plane_size(width, height);
    const int itself = y * width + x;
    if (other_pixel[itself] < 0)
        return;
    other_pixel[itself] = -1;
    const Footprint inside = footprint(view, x, y);
    Window window = window_at(panorama_width, panorama_height, inside.middle);
    const Joints joints = window_joints(panorama_surface, &window);
    const int2 sides = sides_of_gap(&window, joints);
    if (INNER & ~(sides.x | sides.y))
        return;
    const Shown shown = SHOWN;
    see(&window, shown);
    const int2 pure = pure_texels(&window, sides, joints.mixed);
    if (!pure.x)
        return;
    float mixtures;
    const float16 coverage = find_coverage(&window, sides.x, pure, joints.mixed, &mixtures);
    const float2 texels = (float2)(panorama_width, panorama_height);
    const float share
        = pixel_coverage(&window, coverage, inside.right * texels, inside.down * texels);
    const int2 whole = whole_texels(sides, pure, coverage);
    const float3 first = side_color(&window, whole.x), second = side_color(&window, whole.y);
    const float3 blurred = load_planes(color, size, pixel);
    store_planes(color, size, pixel, mix(blurred, mix(second, first, share), mixtures));

    const int is_first = share > 0.5f;
    const float of_first = mix(blurred_coverage(&window, coverage), share, mixtures);
    const float area = is_first ? 1.0f - of_first : of_first;
    const float3 theirs = area * (is_first ? second : first);
    const float3 light = theirs + (1.0f - area) * (is_first ? first : second);
    const int beyond = nearest_texel(&window, is_first ? whole.y : whole.x);
    const float2 there = view_project(view, texel_direction(beyond % panorama_width,
                                                            beyond / panorama_width,
                                                            panorama_width, panorama_height));
    const int in_view = there.x >= 0.0f && there.y >= 0.0f && there.x < width && there.y < height;
    other_pixel[itself] = in_view ? (int)there.y * width + (int)there.x : itself;
    other[itself] = in_view ? (float4)(theirs / fmax(light, FLT_MIN), area) : (float4)(0.0f);

    const int texel = nearest_texel(&window, is_first ? sides.x : sides.y);
    show_surface(texel, inside.direction, BEYOND, previous, panorama_surface, panorama_range, pixel, size,
                 normal, depth, id, motion CAMERA_ARGUMENT);
#ifdef GLOSS
    const int index = panorama_gloss[texel];
    float3 specular = (float3)(0.0f);
    if (index) {
        const Shown part = {panorama_highlight, 0, 0};
        see(&window, part);
        specular = mix(shown_in_pixel(part, panorama_width, panorama_height, inside, 1),
                       mix(side_color(&window, whole.y), side_color(&window, whole.x), share),
                       mixtures);
    }
    show_gloss(index, specular, real_materials, pixel, size, gloss, roughness, highlight);
#endif
}
