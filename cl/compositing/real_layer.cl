// The real layer of a view: the camera's picture without objects.
//
//   kernel             output
//   resample_panorama  surfaces from the panorama; resample_glossy: the same with glossy real surfaces
//   resample_color     radiance from the panorama; resample_highlight: the same with highlights
//   sharpen_edges      depth edges at the resolution of the view (world/real/edges.h), and shares of
//                      uneven pixels; sharpen_glossy: the same with glossy real surfaces
//   diffuse_part       diffuse radiance of real surfaces, in the colors that rays find
//
// in   view       [16]       lib/gbuffer/view.h
//      previous   [16]       view of the previous picture
//      panorama   lib/world/real/real.h surface, range; three floats a texel of color;
//                 -D CLIPPED: its clipped texels (lib/world/real/panorama.h)
// out  color      3 planes   linear radiance, L_cam of IPRT Eq. 2 (reconstruct.h); the panorama's own bits
//                            in an equirect view of its size
//      normal     3 planes   world, facing the capture centre
//      depth      1 plane    metres from the capture centre; 0: open sky
//      id         1 plane    1: surface that takes shadows; 0: opening or open sky
//      motion     2 planes   image point in the previous picture, pixels; -1e9: nowhere
//      place      2 planes   uv of the pixel's centre in the panorama
//      other_pixel [H*W]     -1 in most pixels. In views about as fine as the panorama, or finer: UNEVEN
//                            where the four texels around show several planes. resample_*: the pixel
//                            itself where one of them is at a gap. sharpen_*, which processes those: a
//                            pixel (y * width + x) that shows the other side; the pixel itself: the view
//                            shows none; UNEVEN: no edge
// and from sharpen_*, where other_pixel is not -1
//      other      [H*W]      xyz: share of the other side in the radiance, w: in the area, in [0, 1]; where
//                            UNEVEN, shares of the four texels (lib/world/real/uneven.h)
//      corner     [H*W]      where UNEVEN: four pixels that show these texels
// and from *_glossy, from the panorama's gloss, its radiance for rays, with the highlights
// and without, and the table of real materials
// (lib/world/brdf.h)
//      gloss      1 plane    0: diffuse, else 1 + index of the real material
//      roughness  1 plane    its GGX alpha
//      highlight  3 planes   specular part of the captured radiance; infinite where all of it is
//
// Near a gap, pixels show one side or, on the edge, both by coverage; depth, normal, id and motion belong
// to the side that covers more. With -D CAMERA_MOTION, `camera` (lib/gbuffer/camera.h) gives the motion of
// static surfaces; else they stay in place.
#include "gbuffer/camera.h"
#include "gbuffer/planes.h"
#include "maths/lanes.h"
#include "world/brdf.h"
#include "world/real/color_map.h"
#include "world/real/edges.h"
#include "world/real/uneven.h"
#include <iprt.compositing.real_layer>

#define BEYOND 0.1f // share of a texel's depth within which its plane extends to neighbours

#define PIXEL_ITEM(width, height)                                                                  \
    const int x = get_global_id(0), y = get_global_id(1);                                          \
    if (x >= (width) || y >= (height))                                                             \
        return

// Write the surface that a pixel shows of a texel's plane in direction v. The plane may leave the texel's
// depths by a share `slack`. Returns its distance, 0 without a surface. For lane loops.
static inline ALWAYS_INLINE float show_surface(
    const RealPlanes layer, int texel, float3 v, float slack, int pixel, int size)
{
    __global const float *restrict surface = (__global const float *)layer.panorama_surface + 4 * texel;
    const float gx = surface[0], gy = surface[1], gz = surface[2];
    const int flags = (int)surface[3];
    const int visible = !(flags & SURFACE_NONE);
    const float facing = visible ? -1.0f / sqrt(gx * gx + gy * gy + gz * gz) : 0.0f;
    layer.normal[pixel] = facing * gx;
    layer.normal[size + pixel] = facing * gy;
    layer.normal[2 * size + pixel] = facing * gz;
    __global const float *restrict near_far = (__global const float *)layer.panorama_range + 2 * texel;
    const float2 range = (float2)((1.0f - slack) * near_far[0], (1.0f + slack) * near_far[1]);
    const float inverse = gx * v.x + gy * v.y + gz * v.z;
    const float radius = visible ? surface_radius(0.0f, inverse, 1.0f, 1.0f, range) : 0.0f;
    layer.depth[pixel] = radius;
    layer.id[pixel] = visible && !(flags & SURFACE_OPENING) ? 1.0f : 0.0f;
    return radius;
}

// Write where the previous picture showed the surface at a distance `radius` in direction v.
static inline ALWAYS_INLINE void show_motion(
    const RealPlanes layer, float3 v, float radius, int pixel, int size)
{
    // Only the direction of distant surfaces matters, and of all if the capture centre stays.
    const float3 point
        = layer.camera.rows ? camera_before(layer.camera.rows, v, radius > 0.0f ? 1.0f / radius : 0.0f) : v;
    const float2 before = project_unbranched(layer.previous, point);
    layer.motion[pixel] = before.x;
    layer.motion[size + pixel] = before.y;
}

// Write the radiance of a pixel's highlight; `index` of the real material + 1.
static inline ALWAYS_INLINE void show_highlight(
    int index, int kind, float3 specular, int pixel, int size, __global float *restrict highlight)
{
    const int all = kind == KIND_CONDUCTOR;
    highlight[pixel] = index ? (all ? INFINITY : specular.x) : 0.0f;
    highlight[size + pixel] = index ? (all ? INFINITY : specular.y) : 0.0f;
    highlight[2 * size + pixel] = index ? (all ? INFINITY : specular.z) : 0.0f;
}

// The panorama at its own size keeps its bits: rounded directions would blend in neighbours.
static inline ALWAYS_INLINE int is_panorama(const RealPlanes layer)
{
    return is_equirect(layer.view) && layer.width == layer.panorama_width
        && layer.height == layer.panorama_height && layer.view[0] == 1.0f && layer.view[4] == 1.0f
        && layer.view[8] == 1.0f;
}

// Write all but the radiance of a pixel, and return the texel whose surface it shows.
// `sharp`: edges are marked. For lane loops: without the colors, whose channels are one vector.
static inline ALWAYS_INLINE int resample(int x, int y, int sharp, const RealPlanes layer)
{
    const int pixel = plane_index(x, y, layer.width), size = plane_size(layer.width, layer.height);
    const float3 ahead = local_direction_unbranched(layer.view, (float2)(x + 0.5f, y + 0.5f));
    const float3 direction = view_rotate_to_world(layer.view, ahead);
    const float2 uv = equirect_uv(direction);
    layer.place[pixel] = uv.x;
    layer.place[size + pixel] = uv.y;
    const int texel
        = min((int)(uv.y * layer.panorama_height), layer.panorama_height - 1) * layer.panorama_width
        + min((int)(uv.x * layer.panorama_width), layer.panorama_width - 1);
    const Taps around = equirect_taps(layer.panorama_width, layer.panorama_height, uv);
    __global const float *restrict marks = (__global const float *)layer.panorama_surface + 3;
    const int gap = at_gap((int)marks[4 * around.a]) | at_gap((int)marks[4 * around.b])
        | at_gap((int)marks[4 * around.below_a]) | at_gap((int)marks[4 * around.below_b]);
    const int mark = gap ? y * layer.width + x : is_uneven(layer.panorama_surface, around) ? UNEVEN : -1;
    layer.other_pixel[y * layer.width + x] = sharp ? mark : -1;
    show_motion(layer, direction, show_surface(layer, texel, direction, 0.0f, pixel, size), pixel, size);
    return texel;
}

// Return whether edges are reconstructed at the view's resolution.
static inline ALWAYS_INLINE int is_sharp(const RealPlanes layer)
{
    return points_across(layer.view, layer.panorama_height) == 1 && !is_panorama(layer);
}

__kernel void resample_panorama(const RealPlanes layer)
{
    LANES_ITEM(layer.width, layer.height);
    const int sharp = is_sharp(layer);
    LANE_LOOP
    for (int x = first; x < end; x++)
        resample(x, y, sharp, layer);
}

__kernel void resample_glossy(
    const RealPlanes layer,
    __global const uchar *restrict panorama_gloss,
    __global const float4 *restrict real_materials,
    __global float *restrict gloss,
    __global float *restrict roughness)
{
    LANES_ITEM(layer.width, layer.height);
    const int sharp = is_sharp(layer);
    LANE_LOOP
    for (int x = first; x < end; x++) {
        const int pixel = plane_index(x, y, layer.width);
        const int index = panorama_gloss[resample(x, y, sharp, layer)];
        const Material material = load_material(real_materials, max(index - 1, 0));
        gloss[pixel] = index;
        roughness[pixel] = index ? material.alpha : 0.0f;
    }
}

static inline ALWAYS_INLINE float2 resampled_uv(int x, int y, const RealPlanes layer)
{
    const int pixel = plane_index(x, y, layer.width), size = plane_size(layer.width, layer.height);
    return (float2)(layer.place[pixel], layer.place[size + pixel]);
}

static inline Footprint resampled_footprint(int x, int y, const RealPlanes layer)
{
    const float3 ahead = view_local_direction(layer.view, (float2)(x + 0.5f, y + 0.5f));
    return footprint(layer.view, resampled_uv(x, y, layer), ahead, view_rotate_to_world(layer.view, ahead));
}

// Return the color that a picture has in a pixel, of points_across() lookups.
static inline ALWAYS_INLINE float3 seen_in_pixel(int x, int y, Shown shown, int points, const RealPlanes layer)
{
    const int width = layer.panorama_width, height = layer.panorama_height;
    return points == 1 ? shown_at(shown, width, height, resampled_uv(x, y, layer))
                       : shown_in_pixel(shown, width, height, resampled_footprint(x, y, layer), points);
}

// `points`: 0 in a panorama at its own size.
static inline ALWAYS_INLINE void show_color(int x, int y, int points, const RealPlanes layer)
{
    store_planes(layer.color, plane_size(layer.width, layer.height), plane_index(x, y, layer.width),
                 points ? seen_in_pixel(x, y, layer.shown, points, layer)
                        : shown_color(layer.shown, y * layer.width + x));
}

__kernel void resample_color(const RealPlanes layer)
{
    LANES_ITEM(layer.width, layer.height);
    const int points = is_panorama(layer) ? 0 : points_across(layer.view, layer.panorama_height);
    for (int x = first; x < end; x++)
        show_color(x, y, points, layer);
}

__kernel void resample_highlight(
    const RealPlanes layer,
    __global const float *restrict panorama_radiance,
    __global const float *restrict panorama_radiated,
    __global const float4 *restrict real_materials,
    __global const float *restrict gloss,
    __global float *restrict highlight)
{
    LANES_ITEM(layer.width, layer.height);
    const int points = points_across(layer.view, layer.panorama_height);
    const int of_color = is_panorama(layer) ? 0 : points;
    const Shown part = {panorama_radiance, 0, 0, panorama_radiated};
    for (int x = first; x < end; x++)
        show_color(x, y, of_color, layer);
    // In a loop of its own: in one of both the color takes a seventh longer.
    for (int x = first; x < end; x++) {
        const int pixel = plane_index(x, y, layer.width), index = (int)gloss[pixel];
        show_highlight(index, index ? load_material(real_materials, index - 1).kind : 0,
                       index ? seen_in_pixel(x, y, part, points, layer) : (float3)(0.0f), pixel,
                       plane_size(layer.width, layer.height), highlight);
    }
}

typedef struct {
    int is;         // whether the pixel is at an edge
    int texel;      // whose surface it shows
    float share;    // of the first side in it
    float mixtures; // how well mixtures of both sides explain the texels
    int2 whole;
    Footprint inside;
    Window window;
} Edge;

// Sharpen a pixel; window.red, green and blue are the colors of its window.
static inline ALWAYS_INLINE Edge sharpen(int x, int y, const RealPlanes layer)
{
    const int pixel = plane_index(x, y, layer.width), size = plane_size(layer.width, layer.height);
    const int itself = y * layer.width + x;
    Edge edge;
    edge.is = 0;
    const int mark = layer.other_pixel[itself];
    if (mark == -1)
        return edge;
    const Footprint inside = resampled_footprint(x, y, layer);
    store_corners(layer.shown.color, layer.panorama_surface, layer.panorama_width, layer.panorama_height,
                  inside, x, y, layer.width, layer.height, (__global float *)(layer.other + itself),
                  (__global int *)(layer.corner + itself));
    if (mark == UNEVEN)
        return edge;
    layer.other_pixel[itself] = UNEVEN;
    Window window = window_at(layer.panorama_width, layer.panorama_height, inside.middle);
    const Joints joints = window_joints(layer.panorama_surface, &window);
    const int2 sides = sides_of_gap(&window, joints);
    if (INNER & ~(sides.x | sides.y))
        return edge;
    see(&window, layer.shown);
    const int2 pure = pure_texels(&window, sides, joints.mixed);
    if (!pure.x)
        return edge;
    float mixtures;
    const float16 coverage = find_coverage(&window, sides.x, pure, joints.mixed, &mixtures);
    const float2 texels = (float2)(layer.panorama_width, layer.panorama_height);
    const float share
        = pixel_coverage(&window, coverage, inside.right * texels, inside.down * texels);
    const float blurred_share = blurred_coverage(&window, coverage);
    const int2 whole = whole_texels(sides, pure, coverage);
    const float3 first = side_color(&window, whole.x), second = side_color(&window, whole.y);
    const float3 blurred = load_planes(layer.color, size, pixel);
    store_planes(layer.color, size, pixel, mix(blurred, mix(second, first, share), mixtures));

    const int is_first = share > 0.5f;
    const float of_first = mix(blurred_share, share, mixtures);
    const float area = is_first ? 1.0f - of_first : of_first;
    const float3 theirs = area * (is_first ? second : first);
    const float3 light = theirs + (1.0f - area) * (is_first ? first : second);
    const int beyond = nearest_texel(&window, is_first ? whole.y : whole.x);
    __global const float *restrict view = layer.view + anew(0);
    const float2 there = view_project(view, texel_direction(beyond % layer.panorama_width,
                                                            beyond / layer.panorama_width,
                                                            layer.panorama_width, layer.panorama_height));
    const int in_view = there.x >= 0.0f && there.y >= 0.0f && there.x < layer.width && there.y < layer.height;
    layer.other_pixel[itself] = in_view ? (int)there.y * layer.width + (int)there.x : itself;
    layer.other[itself] = in_view ? (float4)(theirs / fmax(light, FLT_MIN), area) : (float4)(0.0f);

    const int texel = nearest_texel(&window, is_first ? sides.x : sides.y);
    const float3 direction = view_direction(view, (float2)(x + 0.5f, y + 0.5f));
    const float radius = show_surface(layer, texel, direction, BEYOND, pixel, size);
    if (layer.camera.rows)
        show_motion(layer, direction, radius, pixel, size);
    return (Edge){1, texel, share, mixtures, whole, inside, window};
}

__kernel void sharpen_edges(const RealPlanes layer)
{
    PIXEL_ITEM(layer.width, layer.height);
    sharpen(x, y, layer);
}

__kernel void sharpen_glossy(
    const RealPlanes layer,
    __global const uchar *restrict panorama_gloss,
    __global const float *restrict panorama_radiance,
    __global const float *restrict panorama_radiated,
    __global const float4 *restrict real_materials,
    __global float *restrict gloss,
    __global float *restrict roughness,
    __global float *restrict highlight)
{
    PIXEL_ITEM(layer.width, layer.height);
    const Edge edge = sharpen(x, y, layer);
    if (!edge.is)
        return;
    const int index = panorama_gloss[edge.texel], pixel = plane_index(x, y, layer.width);
    const Material material = load_material(real_materials, max(index - 1, 0));
    float3 specular = (float3)(0.0f);
    if (index) {
        const Shown part = {panorama_radiance, 0, 0, panorama_radiated};
        Window window = edge.window;
        see(&window, part);
        specular = mix(shown_at(part, layer.panorama_width, layer.panorama_height, edge.inside.middle),
                       mix(side_color(&window, edge.whole.y), side_color(&window, edge.whole.x),
                           edge.share),
                       edge.mixtures);
    }
    gloss[pixel] = index;
    roughness[pixel] = index ? material.alpha : 0.0f;
    show_highlight(index, material.kind, specular, pixel, plane_size(layer.width, layer.height), highlight);
}

// Writes the bits of `color` without map and highlight; >= 0.
__kernel void diffuse_part(
    __global const float *restrict color,    // 3 planes, radiance of the real layer
    __global const float4 *restrict maps,     // lib/world/real/color_map.h; 0: none
    __global const float *restrict highlight, // 3 planes, in the colors that rays find; 0: none
    __global float *restrict diffuse,         // out: 3 planes
    int width,
    int height)
{
    PIXEL_ITEM(width, height);
    const int size = plane_size(width, height), p = plane_index(x, y, width);
    float3 left = load_planes(color, size, p);
    if (maps)
        left = map_color(maps, TO_REFERENCE, left);
    if (highlight)
        left -= load_planes(highlight, size, p);
    store_planes(diffuse, size, p, fmax(left, 0.0f));
}
