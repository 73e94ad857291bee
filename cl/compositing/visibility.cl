// Visibility of the objects in the view by ray casting from the capture centre: the same as the OpenGL
// rasterizer (iprt/raster/rasterizer.py), for devices without OpenGL and for tests.
//
//   kernel        in                                       out, [height * width]
//   see_objects   objects (objects_bvh.h);                 front: world normal, on the side seen,
//                 displacements: per vertex, to its        radial distance (0: no surface); material:
//                 previous position, object space, or      albedo, 1 + material index; finish, with -D
//                 null; surface, as below                  PRINCIPLED, else null: lib/world/finish.h;
//                                                          emission, with -D EMISSION, else null: radiance;
//                                                          met: instance, -1: none, -2 - instance: behind
//                                                          the real surface, and triangle; displaced: the
//                                                          surface's displacement, world space
//   show_objects  objects; front, material, finish,        display: images (lib/gbuffer/display.h), edge
//                 emission and met, not read elsewhere;    pixels with a borrowed surface
//                 surface: tangent planes of the panorama;
//                 previous view (lib/gbuffer/view.h);
//                 moved: 3 float4 per material, rows of
//                 this frame's world to the previous
//                 frame's
//
// Pixel centres are at integer + 0.5. Both kernels run over a rectangle and write nothing outside. Coverage
// takes samples x samples rays a pixel. With fewer than 4 per side and no textures, only pixels beside
// uncovered ones are sampled. Coverage is 1 - M of Eq. 2 of IPRT ("Interactive panoramic ray tracing"). For
// deforming meshes, the previous position is the displaced point moved by the object's motion.
#include "world/objects/objects_bvh.h"
#include "maths/kernel_attributes.h"
#include "gbuffer/display.h"
#include "gbuffer/pixel_samples.h"
#include "gbuffer/view.h"

#define MARGIN 1.001f // beyond the distance up to which an object can be in front of the real surface

// Largest relative change of distance of a surface borrowed by the adjacent pixel.
#define LENDING_RANGE 0.03f

// Return whether rays of a pixel meet the triangles that rays nearby meet, and need nothing else of them.
static inline int shares_triangles(void)
{
#if defined(HOLES) || defined(TEXTURES)
    return 0;
#else
    return 1;
#endif
}

// Return whether pixels whose neighbours are covered count as covered, as with few samples a side.
static inline int outlines_only(int samples)
{
    return samples < 4 && shares_triangles();
}

TRACING_KERNEL void see_objects(
    const int4 rectangle,                        // x0, y0, x1, y1
    const int width,
    const int height,
    __global const float *restrict view,
    const Objects world,
    __global const float4 *restrict surface,     // xyz = g, g . x = 1 on the real surface
    const int surface_width,
    const int surface_height,
    const int samples,
    __global const float4 *restrict displacements,
    __global float4 *restrict front,
    __global float4 *restrict material,
    __global Finish *restrict finish,
    __global float4 *restrict emission,
    __global int2 *restrict met,
    __global float4 *restrict displaced,
    const Work work)
{
    const int x = rectangle.x + (int)get_global_id(0), y = rectangle.y + (int)get_global_id(1);
    if (x >= rectangle.z || y >= rectangle.w)
        return;
    COUNT_ITEM;
    const int pixel = y * width + x;
    const float3 d = view_direction(view, (float2)(x + 0.5f, y + 0.5f));
    ObjectHit hit;
    front[pixel] = material[pixel] = (float4)(0.0f);
    if (finish)
        finish[pixel] = (Finish)(0.0f);
    if (emission)
        emission[pixel] = (float4)(0.0f);
    met[pixel] = (int2)(-1, 0);
    if (!trace_objects(world, (float3)(0.0f), d, INFINITY, 0, &hit))
        return;
    int instance = hit.instance;
    if (outlines_only(samples)) {
        const float nearness = real_nearness(surface, surface_width, surface_height, d);
        instance = hit.t * nearness <= 1.0f + COVERAGE_TOLERANCE ? instance : -2 - instance;
    }
    met[pixel] = (int2)(instance, hit.triangle);
    const RayCone cone = {0.0f, pixel_angle(view, d)};
    const ObjectSurface at = object_surface(world, hit, d, cone);
    front[pixel] = (float4)(on_seen_side(at, at.normal), hit.t);
    material[pixel] = (float4)(object_albedo(world, at),
                               at.material + 1);
#ifdef COAT_NORMALS
    finish[pixel] = (Finish)(
        object_finish(world, at),
        packed_coat_normal(on_seen_side(at, at.normal), on_seen_side(at, at.coat_normal)));
#else
    if (finish)
        finish[pixel] = object_finish(world, at);
#endif
#ifdef EMISSION
    emission[pixel] = (float4)(object_emission(world, at), 0.0f);
#endif
    if (!displacements)
        return;
    const float3 step = at.weights.x * displacements[at.vertices.x].xyz
        + at.weights.y * displacements[at.vertices.y].xyz
        + at.weights.z * displacements[at.vertices.z].xyz;
    __global const float4 *rows = world.bvh.instances + BVH_INSTANCE_ROWS * hit.instance;
    displaced[pixel] = (float4)(bvh_transform(rows + 3, step, 0.0f), 0.0f);
}

// Return the number of rays that meet an object in front of the real surface, and of rays that meet any.
// `albedo`, `finish` and `emission` get the means over rays that meet material `index` - 1, whatever its variant, which
// average textures finer than pixels. `ahead`: direction of the pixel.
static inline int2 visible_samples(const Objects world, __global const float *restrict view,
                                   __global const int2 *restrict met, int4 rectangle, int x, int y,
                                   int width, float3 ahead, int samples, int index,
                                   __global const float4 *restrict surface, int surface_width,
                                   int surface_height, float3 *albedo, float2 *finish, float3 *emission)
{
    int2 count = (int2)(0);
    int same = 0;
    float3 sum = (float3)(0.0f);
    float2 finish_sum = (float2)(0.0f);
#ifdef EMISSION
    float3 emission_sum = (float3)(0.0f);
#endif
    for (int first = 0; first < samples * samples; first += LANES) {
        Samples rays = aim_samples(view, x, y, samples, first, surface, surface_width, surface_height);
        // Most rays meet triangles that rays nearby meet. Any object in front of them is in front of the real
        // surface too and need not be found.
        if (shares_triangles())
            count += meet_nearby(world, met, rectangle, x, y, width, ahead, &rays);
        for (int i = 0; i < LANES; i++) {
            if (rays.state[i] == KNOWN)
                continue;
            const int behind = rays.state[i] == BEHIND;
            const float limit = (1.0f + COVERAGE_TOLERANCE) / rays.nearness[i];
            const float3 d = (float3)(rays.x[i], rays.y[i], rays.z[i]);
            rays.state[i] = KNOWN;
            ObjectHit hit;
            if (!trace_objects(world, (float3)(0.0f), d, behind ? MARGIN * limit : INFINITY, 0, &hit))
                continue;
            count.x += hit.t * rays.nearness[i] <= 1.0f + COVERAGE_TOLERANCE;
            count.y += !behind;
            if (shares_triangles()) {
                count += meet_packet(world, hit.instance, hit.triangle >> 2, ahead, &rays);
                continue;
            }
            const RayCone cone = {0.0f, pixel_angle(view, d) / samples};
            const ObjectSurface at = object_surface(world, hit, d, cone);
            if (object_material(world, hit) + 1 == index) {
                sum += object_albedo(world, at);
                finish_sum += object_finish(world, at);
#ifdef EMISSION
                emission_sum += object_emission(world, at);
#endif
                same++;
            }
        }
    }
    if (same > 0) {
        *albedo = sum / (float)same;
        *finish = finish_sum / (float)same;
#ifdef EMISSION
        *emission = emission_sum / (float)same;
#endif
    }
    return count;
}

// Return a neighbour with a surface, -1: none.
static inline int nearest_covered_neighbour(__global const float4 *restrict front, int x, int y,
                                            int width, int height, int wraps)
{
    const int2 steps[8] = {STEPS_AROUND};
    for (int i = 0; i < 8; i++) {
        int column = x + steps[i].x;
        const int row = y + steps[i].y;
        if (wraps)
            column = (column + width) % width;
        if (column < 0 || row < 0 || column >= width || row >= height)
            continue;
        if (front[row * width + column].w > 0.0f)
            return row * width + column;
    }
    return -1;
}

// Return 1 + the index of the material at the centre of a pixel, whatever its variant; 0: none.
static inline ALWAYS_INLINE int centre_material(const Objects world, int2 met)
{
    if (met.x == -1)
        return 0;
    ObjectHit hit;
    hit.instance = met.x < 0 ? -2 - met.x : met.x;
    hit.triangle = met.y;
    return object_material(world, hit) + 1;
}

// Return whether all samples of a pixel can be assumed to meet an object in front of the real surface, as
// its centre and its neighbours' centres do.
static inline int is_inside(__global const int2 *restrict met, int4 rectangle, int x, int y, int width)
{
    if (x <= rectangle.x || y <= rectangle.y || x >= rectangle.z - 1 || y >= rectangle.w - 1)
        return 0;
    __global const int2 *centre = met + y * width + x;
    return (centre[0].x | centre[-1].x | centre[1].x | centre[-width].x | centre[width].x) >= 0;
}

TRACING_KERNEL void show_objects(
    const int4 rectangle,                        // x0, y0, x1, y1
    const int width,
    const int height,
    __global const float *restrict view,
    __global const float *restrict previous,     // of the previous frame
    const Objects world,
    __global const float4 *restrict moved,       // rows of the objects' motion, per material
    __global const float4 *restrict surface,     // xyz = g, g . x = 1 on the real surface
    const int surface_width,
    const int surface_height,
    __global const float4 *restrict front,
    __global const float4 *restrict material,
    __global const Finish *restrict finish,
    __global const float4 *restrict emission,
    const int samples,
    __global const int2 *restrict met,
    __global const float4 *restrict displaced,   // or null
    __global float4 *restrict display,
    const Work work)
{
    const int x = rectangle.x + (int)get_global_id(0), y = rectangle.y + (int)get_global_id(1);
    if (x >= rectangle.z || y >= rectangle.w)
        return;
    const int pixel = y * width + x;
    const int size = width * height;
    __global float4 *image = display + pixel;
    const float3 d = view_direction(view, (float2)(x + 0.5f, y + 0.5f));
    float4 seen = front[pixel], its_material = material[pixel];
    int from = seen.w > 0.0f ? -1 : nearest_covered_neighbour(front, x, y, width, height, is_equirect(view));
    // No neighbour to borrow from: most of a rectangle around objects.
    if (!(seen.w > 0.0f) && from < 0) {
        image[DISPLAY_NORMAL * size] = image[DISPLAY_MATERIAL * size] = (float4)(0.0f);
        image[DISPLAY_COVERAGE * size] = (float4)(0.0f, -1e9f, -1e9f, 0.0f);
        if (finish)
            image[DISPLAY_FINISH * size] = (float4)(0.0f);
        if (emission)
            image[DISPLAY_EMISSION * size] = (float4)(0.0f);
        return;
    }
    COUNT_ITEM;
    float3 albedo = its_material.xyz;
    float2 its_finish = finish ? finish[pixel].xy : (float2)(0.0f);
    float3 its_emission = emission ? emission[pixel].xyz : (float3)(0.0f);
    int2 visible = (int2)(samples * samples);
    if (!(outlines_only(samples) && is_inside(met, rectangle, x, y, width)))
        visible = visible_samples(world, view, met, rectangle, x, y, width, d, samples,
                                  centre_material(world, met[pixel]), surface, surface_width, surface_height, &albedo,
                                  &its_finish, &its_emission);
    its_material.xyz = albedo;
    from = visible.y > 0 ? from : -1;
    if (from >= 0) {
        const float4 lent = front[from];
        const float2 at = (float2)(from % width + 0.5f, from / width + 0.5f);
        const float ratio = dot(lent.xyz, view_direction(view, at)) / dot(lent.xyz, d);
        // A plane seen edge-on has no ratio, or one of any size.
        const float moderate = clamp(ratio, 1.0f - LENDING_RANGE, 1.0f + LENDING_RANGE);
        seen = (float4)(lent.xyz, lent.w * (ratio > 0.0f ? moderate : 1.0f));
        its_material = material[from];
        its_finish = finish ? finish[from].xy : its_finish;
        its_emission = emission ? emission[from].xyz : its_emission;
    }
    float2 coverage = convert_float2(visible) / (float)(samples * samples);
    coverage = seen.w > 0.0f ? coverage : (float2)(0.0f);
    float2 motion = (float2)(-1e9f);
    if (seen.w > 0.0f) {
        float3 point = seen.w * d;
        if (displaced)
            point += displaced[from >= 0 ? from : pixel].xyz;
        const float3 before = bvh_transform(moved + 3 * ((int)its_material.w - 1), point, 1.0f);
        motion = view_project(previous, before);
    }
    image[DISPLAY_NORMAL * size] = seen;
    image[DISPLAY_MATERIAL * size] = its_material;
    image[DISPLAY_COVERAGE * size] = (float4)(coverage.x, motion, coverage.y);
    if (finish)
#ifdef COAT_NORMALS
        image[DISPLAY_FINISH * size] = (float4)(its_finish, finish[from >= 0 ? from : pixel].zw);
#else
        image[DISPLAY_FINISH * size] = (float4)(its_finish, 0.0f, 0.0f);
#endif
    if (emission)
        image[DISPLAY_EMISSION * size] = (float4)(its_emission, 0.0f);
}
