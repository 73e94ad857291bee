// The virtual objects as rays see them when rasterized from the capture centre: per texel one solid
// interval, from the tangent plane of the front layer to the back layer's. The screen layers are
// tried first. The equirect layers cover the space outside the screen.
#pragma once

#include "maths/grid.h"
#include "maths/kernel_attributes.h"
#include "world/objects/ray_cone.h"
#include "world/objects/scatterer.h"
#include "gbuffer/view.h"

#if !defined(OBJECTS_BVH) && !defined(DISTANT_ENVIRONMENT)

// Most footprints by which a texel's tangent plane may leave its centre depth.
#define OBJECT_SLOPE 6
// Offset of rays above a surface, in texel footprints of its layer.
#define OBJECT_LIFT 2.0f
// Depth errors up to this many texel footprints do not count as entry into a solid.
#define OBJECT_TOLERANCE 1.0f

typedef struct {
    float t;
    int index;        // into geometry and material, including the layer
    int on_screen;    // the ObjectLayer
    int outside;      // 0 while the ray is still inside the solid that it started in
    int from;         // the side that the ray comes from: FROM_*
} ObjectHit;

#define FROM_NOWHERE 0   // beside the objects: nothing is rasterized in the last direction
#define FROM_FRONT 1     // nearer than the front
#define FROM_BACK 2      // farther than the back

static inline float plane_radius(float4 plane, float gx, float r, float nearest, float farthest)
{
    const float radius = gx > 0.0f ? r / gx : INFINITY;
    return clamp(radius, plane.w * nearest, plane.w * farthest);
}

// Intersect the solid interval of one texel with the segment [t0, t1] of the ray, whose radii are r0 and
// r1. A ray enters once it is deeper than the tolerance, in this texel or a later one. Solids thinner than
// that, such as a shell seen from inside, are hit because the ray came from their other side.
static inline int object_leaf(const ObjectLayer layer, float3 o, float3 d, int texel, float t0, float t1,
                       float r0, float r1, ObjectHit *hit)
{
    const float4 front = layer.planes[2 * texel], back = layer.planes[2 * texel + 1];
    if (!(front.w > 0.0f)) {
        hit->outside = 1;
        hit->from = FROM_NOWHERE;
        return 0;
    }
    const float tolerance = OBJECT_TOLERANCE * layer.footprint * front.w;
    const float go = dot(front.xyz, o), gd = dot(front.xyz, d);
    const float ho = dot(back.xyz, o), hd = dot(back.xyz, d);
    // Distance past the front, and distance before the back.
    const float past0 = r0 - plane_radius(front, go + t0 * gd, r0, layer.nearest, layer.farthest);
    const float past1 = r1 - plane_radius(front, go + t1 * gd, r1, layer.nearest, layer.farthest);
    const float before0 = plane_radius(back, ho + t0 * hd, r0, layer.nearest, layer.farthest) - r0;
    const float before1 = plane_radius(back, ho + t1 * hd, r1, layer.nearest, layer.farthest) - r1;
    const int inside = past0 > tolerance && before0 > tolerance;
    if (!hit->outside) {
        hit->outside = !inside || past1 <= tolerance || before1 <= tolerance;
        if (inside)
            return 0;
    }
    // A step no larger than the steepest plane's stays on the same surface. Past a larger step, and from
    // beside the objects, the ray's side follows from its position.
    const float step = layer.slope * front.w;
    if (hit->from == FROM_NOWHERE || (hit->from == FROM_FRONT ? past0 : before0) > step) {
        const int nearer = past0 <= 0.0f || (past0 <= tolerance && before0 > 0.0f);
        hit->from = nearer || (inside && past0 <= before0) ? FROM_FRONT : FROM_BACK;
    }
    const int texels = layer.grid.width * layer.grid.height;
    float t = t0;
    if (hit->from == FROM_FRONT) {
        if (!(fmax(past0, past1) > tolerance))
            return 0;
        t = past0 <= 0.0f ? (1.0f - go) / gd : t0;
        hit->index = texel;
    } else {
        if (!(fmax(before0, before1) > tolerance))
            return 0;
        t = before0 <= 0.0f ? (1.0f - ho) / hd : t0;
        hit->index = texels + texel;
    }
    hit->t = t >= t0 && t <= t1 ? t : t0;
    return 1;
}

typedef struct {
    float3 o;
    float3 d;
    float t_max;
} ObjectRay;

static inline int equirect_leaf(const ObjectLayer layer, const ObjectRay line, const PolarRay ray,
                         const Segment at, ObjectHit *hit)
{
    return object_leaf(layer, line.o, line.d, at.row * layer.grid.width + at.column,
                       polar_t(ray, at.u0), polar_t(ray, at.u1), ray.b * at.root0,
                       ray.b * at.root1, hit);
}

// Return whether the ray passes a cell on one side of all its surfaces. A ray from the other side does not
// skip it, because a thin solid might lie between.
static inline int object_skip(float near, float far, float2 range, ObjectHit *hit)
{
    const int empty = range.x > range.y;
    const int nearer = far < range.x && hit->from != FROM_BACK;
    const int farther = near > range.y && hit->from != FROM_FRONT;
    if (!(empty || nearer || farther))
        return 0;
    hit->outside = 1;
    hit->from = empty ? FROM_NOWHERE : nearer ? FROM_FRONT : FROM_BACK;
    return 1;
}

#define MARCH_NAME march_equirect_objects
#define MARCH_LAYER ObjectLayer
#define MARCH_STATE ObjectRay
#define MARCH_HIT ObjectHit
#define MARCH_WORK WORK_OBJECTS
#define MARCH_SKIP(state, near, far, range, cell) object_skip(near, far, range, hit)
#define MARCH_LEAF(layer, ray, at, state, hit) equirect_leaf(layer, *(state), ray, at, hit)
#define MARCH_END(state) 0
#include "world/real/march.h"

static inline int trace_equirect_objects(const ObjectLayer layer, float3 o, float3 d, float t0, float t1,
                                  ObjectHit *hit)
{
    if (!(t1 > t0))
        return 0;
    PolarRay ray = polar_ray(o, d);
    if (!(ray.b > 1e-6f * fabs(ray.od))) {
        // Through the capture centre, any perpendicular can be the direction of closest approach.
        ray.m = normalize(fabs(d.y) < 0.9f ? (float3)(-d.z, 0.0f, d.x) : (float3)(0.0f, -d.z, d.y));
        ray.b = fmax(1e-6f * fabs(ray.od), 1e-20f);
    }
    const ObjectRay line = {o, d, t1};
    hit->on_screen = 0;
    return march_equirect_objects(layer, ray, t0, t1, line, hit) == 1;
}

#ifndef VIEW_EQUIRECT
// Clip [*t0, *t1] to the part where a + t b >= 0.
static inline void clip_half_space(float a, float b, float *t0, float *t1)
{
    const float t = -a / b;
    if (b > 0.0f)
        *t0 = fmax(*t0, t);
    else if (b < 0.0f)
        *t1 = fmin(*t1, t);
    else if (a < 0.0f)
        *t1 = -INFINITY;
}

// Return the part of the ray that projects into the screen rectangle covered by objects.
static inline float2 clip_to_rectangle(const Objects world, float3 o, float3 d, float t0, float t1)
{
    const float focal = world.view[9], cx = world.view[10], cy = world.view[11];
    const float left = world.edges.x - cx, right = world.edges.z - cx;
    const float upper = world.edges.y - cy, lower = world.edges.w - cy;
    clip_half_space(focal * o.x + left * o.z, focal * d.x + left * d.z, &t0, &t1);
    clip_half_space(-focal * o.x - right * o.z, -focal * d.x - right * d.z, &t0, &t1);
    clip_half_space(-focal * o.y + upper * o.z, -focal * d.y + upper * d.z, &t0, &t1);
    clip_half_space(focal * o.y - lower * o.z, focal * d.y - lower * d.z, &t0, &t1);
    return (float2)(t0, t1);
}

// March hierarchically through the screen layers; o and d in view space. Cell edges are planes through the
// capture centre, so crossings are exact in t.
static inline int march_screen_objects(const Objects world, float3 o, float3 d, float t0, float t1,
                                float3 o_world, float3 d_world, ObjectHit *hit)
{
    const ObjectLayer layer = world.screen;
    const float focal = world.view[9], cx = world.view[10], cy = world.view[11];
    const int width = layer.grid.width, height = layer.grid.height;
    const int rightward = o.x * d.z - o.z * d.x >= 0.0f;
    const int downward = d.y * o.z - o.y * d.z >= 0.0f;
    const float od = dot(o, d), oo = dot(o, o);

    float t = t0;
    const float3 start = o + t * d;
    int column = clamp((int)(cx - focal * start.x / start.z), world.rectangle.x,
                       world.rectangle.z - 1);
    int row = clamp((int)(cy + focal * start.y / start.z), world.rectangle.y,
                    world.rectangle.w - 1);
    int level = 0, offset = 0, entry = ENTRY_START;
    for (int step = 0; step < MARCH_STEP_CAP; step++) {
        const int columns = cells_along(width, level), rows = cells_along(height, level);
        const float x = min((column + rightward) << level, width) - cx;
        const float y = min((row + downward) << level, height) - cy;
        // A ray crosses edges in its own direction only.
        const float x_speed = focal * d.x + x * d.z, y_speed = focal * d.y - y * d.z;
        const float t_x = -(focal * o.x + x * o.z) / x_speed;
        const float t_y = -(focal * o.y - y * o.z) / y_speed;
        const float side = (rightward ? x_speed : -x_speed) > 0.0f ? fmax(t_x, t) : INFINITY;
        const float level_edge = (downward ? -y_speed : y_speed) > 0.0f ? fmax(t_y, t) : INFINITY;
        const float next = fmin(fmin(side, level_edge), t1);
        const float r0 = sqrt(fmax(oo + t * (2.0f * od + t), 0.0f));
        const float r1 = sqrt(fmax(oo + next * (2.0f * od + next), 0.0f));
        const float near = t < -od && next > -od ? sqrt(fmax(oo - od * od, 0.0f)) : fmin(r0, r1);
        const float2 range = layer.grid.range[offset + row * columns + column];
        if (!object_skip(near, fmax(r0, r1), range, hit)) {
            if (level > 0) {
                level--;
                const int child_columns = cells_along(width, level);
                const int child_rows = cells_along(height, level);
                const float3 p = o + t * d;
                const int right = entry == ENTRY_WEST ? 0 : entry == ENTRY_EAST ? 1
                    : focal * p.x > -(((2 * column + 1) << level) - cx) * p.z;
                const int lower = entry == ENTRY_NORTH ? 0 : entry == ENTRY_SOUTH ? 1
                    : focal * p.y < (((2 * row + 1) << level) - cy) * p.z;
                column = min(2 * column + right, child_columns - 1);
                row = min(2 * row + lower, child_rows - 1);
                offset -= child_columns * child_rows;
                continue;
            }
            if (object_leaf(layer, o_world, d_world, row * width + column, t, next, r0, r1, hit)) {
                COUNT_STEPS(layer.grid.work, WORK_OBJECTS, step + 1);
                return 1;
            }
        }
        if (next >= t1) {
            COUNT_STEPS(layer.grid.work, WORK_OBJECTS, step + 1);
            return 0;
        }
        t = next;
        const int old_column = column, old_row = row;
        if (side <= level_edge) {
            entry = rightward ? ENTRY_WEST : ENTRY_EAST;
            column += rightward ? 1 : -1;
        } else {
            entry = downward ? ENTRY_NORTH : ENTRY_SOUTH;
            row += downward ? 1 : -1;
        }
        if (column < 0 || row < 0 || column >= columns || row >= rows)
            return 0;
        if (level + 1 < layer.grid.levels
            && (column >> 1 != old_column >> 1 || row >> 1 != old_row >> 1)) {
            offset += columns * rows;
            level++;
            column >>= 1;
            row >>= 1;
        }
    }
    return 0;
}
#endif

// Return the part of the ray inside the bounding boxes of the objects.
static inline float2 bounds_interval(const Objects world, float3 o, float3 d, float t_max)
{
    float2 interval = (float2)(INFINITY, -INFINITY);
    for (int i = 0; i < world.count; i++) {
        const float3 a = (world.bounds[2 * i].xyz - o) / d;
        const float3 b = (world.bounds[2 * i + 1].xyz - o) / d;
        const float3 low = fmin(a, b), high = fmax(a, b);
        const float enter = fmax(fmax(low.x, low.y), fmax(low.z, 0.0f));
        const float leave = fmin(fmin(high.x, high.y), fmin(high.z, t_max));
        if (enter <= leave)
            interval = (float2)(fmin(interval.x, enter), fmax(interval.y, leave));
    }
    return interval;
}

// Find the nearest virtual surface along the ray before t_max. Returns 1 if there is one. `outside` = 0 for
// a ray that starts on an object and might start below its rasterized surface.
static inline int trace_objects(
    const Objects world, float3 o, float3 d, float t_max, int any, ObjectHit *hit)
{
    if (!is_ray(o, d))
        return 0;
    COUNT_RAY(world.equirect.grid.work, WORK_OBJECTS);
    const float2 reach = bounds_interval(world, o, d, t_max);
    if (!(reach.x <= reach.y))
        return 0;
    hit->outside = 0;
    hit->from = FROM_NOWHERE;
#ifdef VIEW_EQUIRECT
    return trace_equirect_objects(world.equirect, o, d, reach.x, reach.y, hit);
#else
    const float3 o_view = view_rotate_to_local(world.view, o);
    const float3 d_view = view_rotate_to_local(world.view, d);
    float2 seen = clip_to_rectangle(world, o_view, d_view, reach.x, reach.y);
    if (!(seen.x < seen.y))
        seen = (float2)(reach.y);
    // Before, on and after the screen. A loop, because each call of a march is inlined.
    for (int part = 0; part < 3; part++) {
        const float t0 = part == 0 ? reach.x : part == 1 ? seen.x : seen.y;
        const float t1 = part == 0 ? seen.x : part == 1 ? seen.y : reach.y;
        if (!(t0 < t1))
            continue;
        hit->on_screen = part == 1;
        if (part == 1 ? march_screen_objects(world, o_view, d_view, t0, t1, o, d, hit)
                      : trace_equirect_objects(world.equirect, o, d, t0, t1, hit))
            return 1;
    }
    return 0;
#endif
}

static inline Scatterer object_point(const Objects world, const ObjectHit hit, float3 o, float3 d, RayCone cone)
{
#ifdef VIEW_EQUIRECT
#define OF_LAYER(member) world.equirect.member
#else
// Members are selected singly: compilers put structs selected by a condition on the stack.
#define OF_LAYER(member) (hit.on_screen ? world.screen.member : world.equirect.member)
#endif
    __global const float4 *geometries = OF_LAYER(geometry);
    const int texels = OF_LAYER(grid.width) * OF_LAYER(grid.height);
    // The solid's flank lies between the layers and is not stored. The layer that faces the ray stands for
    // it: the other one would scatter the ray into the solid.
    const int opposite = hit.index < texels ? hit.index + texels : hit.index - texels;
    const int flank = dot(geometries[hit.index].xyz, d) > 0.0f
        && dot(geometries[opposite].xyz, d) < 0.0f;
    const int index = flank ? opposite : hit.index;
    const float4 geometry = geometries[index];
    const float4 material = OF_LAYER(material)[index];
    Scatterer point;
    point.normal = dot(geometry.xyz, d) > 0.0f ? -geometry.xyz : geometry.xyz;
    point.position = o + hit.t * d + OBJECT_LIFT * OF_LAYER(footprint) * geometry.w * point.normal;
    point.albedo = material.xyz;
    point.finish = (Finish)(-1.0f);
#ifdef EMISSION
    point.emission = (float3)(-1.0f);
    point.facing = 1.0f;
#endif
    point.material = (int)material.w - 1;
    return point;
}

#undef OF_LAYER

// Return the offset in metres, along the normal, of rays that leave an object seen at this distance.
static inline float object_lift(const Objects world, float distance)
{
#ifdef VIEW_EQUIRECT
    return OBJECT_LIFT * world.equirect.footprint * distance;
#else
    return OBJECT_LIFT * world.screen.footprint * distance;
#endif
}

#endif
