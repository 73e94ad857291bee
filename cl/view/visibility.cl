// Visibility of the objects in the view by ray casting from the capture centre: the same as the OpenGL
// rasterizer (iprt/raster/rasterizer.py), for devices without OpenGL and for tests.
//
//   kernel        in                                       out, [height * width]
//   see_objects   objects (objects_bvh.h);                 front: world normal as in the mesh,
//                 displacements: per vertex, to its        radial distance (0: no surface); material:
//                 previous position, object space, or      albedo, 1 + material index; finish, with -D
//                 null; surface, as below                  PRINCIPLED, else null: metalness, alpha;
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
#include "maths/lanes.h"
#include "gbuffer/display.h"
#include "gbuffer/view.h"

#define STEPS_AROUND {-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-1, -1}, {1, -1}, {-1, 1}, {1, 1}
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

// Return 1 / distance of the real surface along d. For lane loops.
static inline ALWAYS_INLINE float real_nearness(
    __global const float4 *restrict surface, int surface_width, int surface_height, float3 d)
{
    __global const float *restrict plane = (__global const float *)surface
        + 4 * equirect_texel(equirect_uv(d), surface_width, surface_height);
    return plane[0] * d.x + plane[1] * d.y + plane[2] * d.z;
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
    __global float2 *restrict finish,
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
        finish[pixel] = (float2)(0.0f);
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
    front[pixel] = (float4)(at.normal, hit.t);
    material[pixel] = (float4)(object_albedo(world, at),
                               at.material + 1);
    if (finish)
        finish[pixel] = object_finish(world, at);
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

// Samples of a pixel, LANES of them.
typedef struct {
    float x[LANES], y[LANES], z[LANES]; // world directions of their rays
    float nearness[LANES];              // of the real surface
    int state[LANES];
} Samples;

// States of samples.
#define KNOWN 0
#define UNKNOWN 1
#define BEHIND 2 // meets an object behind the real surface; maybe another one in front

// Return the samples from number `first` on.
static inline ALWAYS_INLINE Samples aim_samples(
    __global const float *restrict view, int x, int y, int samples, int first,
    __global const float4 *restrict surface, int surface_width, int surface_height)
{
    Samples rays;
    LANE_LOOP
    for (int i = 0; i < LANES; i++) {
        const int number = first + i, row = number / samples, column = number - row * samples;
        const float right = (column + 0.5f) / samples, down = (row + 0.5f) / samples;
        const float3 d = direction_unbranched(view, (float2)(x + right, y + down));
        rays.x[i] = d.x;
        rays.y[i] = d.y;
        rays.z[i] = d.z;
        rays.nearness[i] = real_nearness(surface, surface_width, surface_height, d);
        rays.state[i] = number < samples * samples ? UNKNOWN : KNOWN;
    }
    return rays;
}

// Find the samples that meet a triangle of a packet, by bvh_packet()'s test. Returns how many become known to
// meet one in front of the real surface, and any. `ahead`: direction of the pixel.
static inline ALWAYS_INLINE int2 meet_packet(
    const Objects world, int instance, int packet, float3 ahead, Samples *rays)
{
#pragma OPENCL FP_CONTRACT OFF
    COUNT_STEPS(world.bvh.work, WORK_OBJECTS, 1);
    __global const float4 *rows = world.bvh.instances + BVH_INSTANCE_ROWS * instance;
    __global const float *corners
        = (__global const float *)(world.bvh.packets + BVH_PACKET_ROWS * packet);
    const float3 start = bvh_transform(rows, (float3)(0.0f), 1.0f);
    const int kz = bvh_ray(start, bvh_transform(rows, ahead, 0.0f)).kz;
    const int kx = bvh_next_axis(kz), ky = bvh_next_axis(kx);
    const float3 o = bvh_permuted(start, kz);
    // Scalars, for the loop.
    const float4 row_x = rows[kx], row_y = rows[ky], row_z = rows[kz];
    const float xx = row_x.x, xy = row_x.y, xz = row_x.z;
    const float yx = row_y.x, yy = row_y.y, yz = row_y.z;
    const float zx = row_z.x, zy = row_z.y, zz = row_z.z;
    const float ox = o.x, oy = o.y, oz = o.z;
    __global const float *cx = corners + 4 * kx, *cy = corners + 4 * ky, *cz = corners + 4 * kz;
    int visible = 0, any = 0;
    LANE_LOOP
    for (int i = 0; i < LANES; i++) {
        const float x = rays->x[i], y = rays->y[i], z = rays->z[i];
        const float inverse = 1.0f / (zx * x + zy * y + zz * z);
        const float shear_x = (xx * x + xy * y + xz * z) * inverse;
        const float shear_y = (yx * x + yy * y + yz * z) * inverse;
        int met = 0, front = 0;
        #pragma unroll
        for (int column = 0; column < 4; column++) {
            const float az = cz[column] - oz, bz = cz[column + 12] - oz;
            const float dz = cz[column + 24] - oz;
            const float ax = (cx[column] - ox) - shear_x * az;
            const float bx = (cx[column + 12] - ox) - shear_x * bz;
            const float dx = (cx[column + 24] - ox) - shear_x * dz;
            const float ay = (cy[column] - oy) - shear_y * az;
            const float by = (cy[column + 12] - oy) - shear_y * bz;
            const float dy = (cy[column + 24] - oy) - shear_y * dz;
            const float u = dx * by - dy * bx, v = ax * dy - ay * dx, w = bx * ay - by * ax;
            const int inside = ((u >= 0.0f) & (v >= 0.0f) & (w >= 0.0f))
                | ((u <= 0.0f) & (v <= 0.0f) & (w <= 0.0f));
            const float t = (u * az + v * bz + w * dz) * inverse / (u + v + w);
            met |= inside & (t > 0.0f);
            front |= inside & (t > 0.0f) & (t * rays->nearness[i] <= 1.0f + COVERAGE_TOLERANCE);
        }
        const int state = rays->state[i];
        rays->state[i] = (state == KNOWN) | front ? KNOWN : met ? BEHIND : state;
        visible += front & (state != KNOWN);
        any += met & (state == UNKNOWN);
    }
    return (int2)(visible, any);
}

// Find the samples of a pixel that meet packets which its centre and the adjacent pixels' meet.
static inline ALWAYS_INLINE int2 meet_nearby(const Objects world, __global const int2 *restrict met,
                                             int4 rectangle, int x, int y, int width, float3 ahead,
                                             Samples *rays)
{
    const int2 steps[9] = {STEPS_AROUND, {0, 0}};
    int2 count = (int2)(0);
    int last = -1;
    for (int i = 0; i < 9 && count.x < LANES; i++) {
        const int column = x + steps[8 - i].x, row = y + steps[8 - i].y;
        if (column < rectangle.x || row < rectangle.y || column >= rectangle.z || row >= rectangle.w)
            continue;
        const int2 there = met[row * width + column];
        const int packet = there.y >> 2;
        if (there.x == -1 || packet == last)
            continue;
        count += meet_packet(world, there.x < 0 ? -2 - there.x : there.x, packet, ahead, rays);
        last = packet;
    }
    return count;
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
    __global const float2 *restrict finish,
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
    float2 its_finish = finish ? finish[pixel] : (float2)(0.0f);
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
        its_finish = finish ? finish[from] : its_finish;
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
        image[DISPLAY_FINISH * size] = (float4)(its_finish, 0.0f, 0.0f);
    if (emission)
        image[DISPLAY_EMISSION * size] = (float4)(its_emission, 0.0f);
}
