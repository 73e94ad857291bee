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
//      other_pixel [H*W]     the pixel itself: one of the four texels around is at a gap, and the view is about
//                            as fine as the panorama, or finer: sharpen.cl goes on; else -1
// and with -D GLOSS, from the panorama's gloss, highlight and the table of real materials
// (lib/world/brdf.h)
//      gloss      1 plane    0: diffuse, else 1 + index of the real material
//      roughness  1 plane    GGX alpha of that
//      highlight  3 planes   specular part of what the camera saw; infinite where all of it is
// With -D CAMERA_MOTION, `camera` (lib/gbuffer/camera.h) tells where surfaces were; else they stayed.
#include "world/real/real_layer.h"

__kernel void resample_panorama(REAL_LAYER_PARAMETERS)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int pixel = plane_index(x, y, width), size = plane_size(width, height);
    const Footprint inside = footprint(view, x, y);
    const float2 uv = inside.middle;
    int texel = min((int)(uv.y * panorama_height), panorama_height - 1) * panorama_width
        + min((int)(uv.x * panorama_width), panorama_width - 1);
    const Shown shown = SHOWN;
    const int points = points_across(view, panorama_height);
    float3 radiance;
#ifdef EDGES
    const Taps around = equirect_taps(panorama_width, panorama_height, uv);
    __global const float *restrict marks = (__global const float *)panorama_surface + 3;
    const int gap = at_gap((int)marks[4 * around.a]) || at_gap((int)marks[4 * around.b])
        || at_gap((int)marks[4 * around.below_a]) || at_gap((int)marks[4 * around.below_b]);
    other_pixel[y * width + x] = gap && points == 1 ? y * width + x : -1;
#endif
    // The panorama at its own size keeps its bits: rounded directions would blend in neighbours.
    if (is_equirect(view) && width == panorama_width && height == panorama_height
        && view[0] == 1.0f && view[4] == 1.0f && view[8] == 1.0f) {
        texel = y * width + x;
        radiance = (float3)(shown_texel(shown, texel, 0), shown_texel(shown, texel, 1),
                            shown_texel(shown, texel, 2));
#ifdef EDGES
        other_pixel[texel] = -1;
#endif
    } else {
        radiance = shown_in_pixel(shown, panorama_width, panorama_height, inside, points);
    }
    color[pixel] = radiance.x;
    color[size + pixel] = radiance.y;
    color[2 * size + pixel] = radiance.z;
    show_surface(texel, inside.direction, 0.0f, previous, panorama_surface, panorama_range, pixel, size,
                 normal, depth, id, motion CAMERA_ARGUMENT);
#ifdef GLOSS
    const Shown part = {panorama_highlight, 0, 0};
    const float3 specular
        = shown_in_pixel(part, panorama_width, panorama_height, inside, points);
    show_gloss(panorama_gloss[texel], specular, real_materials, pixel, size, gloss, roughness, highlight);
#endif
}
