// Visibility of the objects in the view by ray casting from the capture centre: the same as the OpenGL
// rasterizer (iprt/raster/rasterizer.py), for devices without OpenGL and for tests.
//
//   kernel        in                                       out, [height * width]
//   see_objects   objects (objects_bvh.h);                 front: world normal as in the mesh,
//                 displacements: per vertex, to its        radial distance (0: no surface); material:
//                 previous position, object space, or      albedo, 1 + material index; met: instance,
//                 null; surface, as below                  -1: none, -2 - instance: behind the real
//                                                          surface, and triangle; displaced: the
//                                                          surface's displacement, world space
//   show_objects  objects; front, material and met, not    display, three images: the same, edge
//                 read elsewhere; surface: tangent         pixels with a borrowed surface; and coverage:
//                 planes of the panorama; previous view    fraction of the pixel in which an object
//                 (lib/gbuffer/view.h); moved: 3 float4    is in front of the real surface, motion:
//                 per material, rows of this frame's       image point in the previous view, pixels,
//                 world to the previous frame's            (-1e9, -1e9): nowhere; and fraction in
//                                                          which there is any object
//
// Pixel centres are at integer + 0.5. Both kernels run over a rectangle and write nothing outside. Coverage
// takes samples x samples rays a pixel. With fewer than 4 per side and no textures, only pixels beside
// uncovered ones are sampled. Coverage is 1 - M of Eq. 2 of IPRT ("Interactive panoramic ray tracing"). For
// deforming meshes, the previous position is the displaced point moved by the object's motion.
#include "world/objects/objects_bvh.h"
#include "maths/kernel_attributes.h"
#include "gbuffer/view.h"

// Largest relative change of distance of a surface borrowed by the adjacent pixel.
#define LENDING_RANGE 0.03f

// Return whether pixels whose neighbours are covered count as covered, as with few samples a side.
static inline int outlines_only(const Objects world, int samples)
{
    return samples < 4 && !world.bvh.texels;
}

// Return 1 / distance of the real surface along d.
static inline float real_nearness(
    __global const float4 *restrict surface, int surface_width, int surface_height, float3 d)
{
    const float2 uv = equirect_uv(d);
    const int texel = min((int)(uv.y * surface_height), surface_height - 1) * surface_width
        + min((int)(uv.x * surface_width), surface_width - 1);
    return dot(surface[texel].xyz, d);
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
    met[pixel] = (int2)(-1, 0);
    if (!trace_objects(world, (float3)(0.0f), d, INFINITY, 0, &hit))
        return;
    int instance = hit.instance;
    if (outlines_only(world, samples)) {
        const float nearness = real_nearness(surface, surface_width, surface_height, d);
        instance = hit.t * nearness <= 1.0f + COVERAGE_TOLERANCE ? instance : -2 - instance;
    }
    met[pixel] = (int2)(instance, hit.triangle);
    const ObjectSurface at = object_surface(world, hit, d);
    front[pixel] = (float4)(at.normal, hit.t);
    material[pixel] = (float4)(object_albedo(world, at.material, at.vertices, at.weights),
                               at.material + 1);
    if (!displacements)
        return;
    const float3 step = at.weights.x * displacements[at.vertices.x].xyz
        + at.weights.y * displacements[at.vertices.y].xyz
        + at.weights.z * displacements[at.vertices.z].xyz;
    __global const float4 *rows = world.bvh.instances + BVH_INSTANCE_ROWS * hit.instance;
    displaced[pixel] = (float4)(bvh_transform(rows + 3, step, 0.0f), 0.0f);
}

// Return whether the ray along d meets a triangle of the packet of `hit`, as bvh_trace() would.
static inline int meets_packet_again(const Objects world, float3 d, ObjectHit *hit)
{
    __global const float4 *rows = world.bvh.instances + BVH_INSTANCE_ROWS * hit->instance;
    const BvhRay ray = bvh_ray(bvh_transform(rows, (float3)(0.0f), 1.0f),
                               bvh_transform(rows, d, 0.0f));
    COUNT_STEPS(world.bvh.work, WORK_OBJECTS, 1);
    hit->t = INFINITY;
    return bvh_packet(world.bvh, ray, hit->triangle >> 2, hit);
}

// Return the number of rays that meet an object in front of the real surface, and of rays that meet any.
// `albedo` gets the mean over rays that meet material `index` - 1, which averages textures finer than
// pixels. `near`: instance and triangle that an adjacent ray meets.
static inline int2 visible_samples(const Objects world, __global const float *restrict view, int x,
                                   int y, int samples, int index, int2 near,
                                   __global const float4 *restrict surface, int surface_width,
                                   int surface_height, float3 *albedo)
{
    int visible = 0, any = 0, same = 0;
    float3 sum = (float3)(0.0f);
    ObjectHit hit;
    hit.instance = near.x < 0 ? -2 - near.x : near.x;
    hit.triangle = near.y;
    for (int i = 0; i < samples * samples; i++) {
        const float2 within = ((float2)(i % samples, i / samples) + 0.5f) / samples;
        const float3 d = view_direction(view, (float2)(x, y) + within);
        const float nearness = real_nearness(surface, surface_width, surface_height, d);
        // Most rays of a pixel meet the same triangles as its centre or the previous ray. Any object in
        // front of them is in front of the real surface too and need not be found.
        if (!world.bvh.texels && meets_packet_again(world, d, &hit)
            && hit.t * nearness <= 1.0f + COVERAGE_TOLERANCE) {
            visible++;
            any++;
            continue;
        }
        if (!trace_objects(world, (float3)(0.0f), d, INFINITY, 0, &hit))
            continue;
        any++;
        visible += hit.t * nearness <= 1.0f + COVERAGE_TOLERANCE;
        if (!world.bvh.texels)
            continue;
        const ObjectSurface at = object_surface(world, hit, d);
        if (at.material + 1 == index) {
            sum += object_albedo(world, at.material, at.vertices, at.weights);
            same++;
        }
    }
    if (same > 0)
        *albedo = sum / (float)same;
    return (int2)(visible, any);
}

// Return a neighbour with a surface, -1: none.
static inline int nearest_covered_neighbour(__global const float4 *restrict front, int x, int y,
                                            int width, int height, int wraps)
{
    const int2 steps[8] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-1, -1}, {1, -1}, {-1, 1}, {1, 1}};
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
    const float3 d = view_direction(view, (float2)(x + 0.5f, y + 0.5f));
    float4 seen = front[pixel], its_material = material[pixel];
    int from = seen.w > 0.0f ? -1 : nearest_covered_neighbour(front, x, y, width, height, is_equirect(view));
    // No neighbour to borrow from: most of a rectangle around objects.
    if (!(seen.w > 0.0f) && from < 0) {
        display[pixel] = display[width * height + pixel] = (float4)(0.0f);
        display[2 * width * height + pixel] = (float4)(0.0f, -1e9f, -1e9f, 0.0f);
        return;
    }
    COUNT_ITEM;
    float3 albedo = its_material.xyz;
    int2 visible = (int2)(samples * samples);
    if (!(outlines_only(world, samples) && is_inside(met, rectangle, x, y, width)))
        visible = visible_samples(world, view, x, y, samples, (int)its_material.w,
                                  met[from < 0 ? pixel : from], surface, surface_width,
                                  surface_height, &albedo);
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
    display[pixel] = seen;
    display[width * height + pixel] = its_material;
    display[2 * width * height + pixel] = (float4)(coverage.x, motion, coverage.y);
}
