// Sampling of directions towards the bounding boxes of virtual objects, the only ones in which rays can
// find an effect of objects.
//
// A box is sampled by its faces that look at x: a face in proportion to (nearly) its solid angle, and a
// point on it uniformly. boxes[2 i] and boxes[2 i + 1] are the lower and upper corner of box i, world,
// metres.
#pragma once

#include "maths/maths.h"

// A surface point from which boxes are seen.
typedef struct {
    float3 x;
    float3 n;
    float total;   // sum of the faces' weights; 0: no face to aim at
    int inside;    // x is in a box: its object may be in any direction
    int above;     // a box reaches above the surface: else no object matters here
} BoxView;

// Return whether objects can affect the surface: a box lies above it, and all boxes span about
// `min_solid_angle` sr or more; or that is negative.
static inline int boxes_matter(const BoxView at, float min_solid_angle)
{
    return min_solid_angle < 0.0f || at.above && (at.inside || at.total >= min_solid_angle);
}

// Selected by bits: compilers for GPUs put indexed vectors on the stack.
static inline float component(float3 v, int axis)
{
    const int3 chosen = as_int3(v) & ((int3)(axis) == (int3)(0, 1, 2));
    return as_float(chosen.x | chosen.y | chosen.z);
}

static inline float3 with_component(float3 v, int axis, float value)
{
    return (float3)(axis == 0 ? value : v.x, axis == 1 ? value : v.y, axis == 2 ? value : v.z);
}

static inline float face_area(float3 size, int axis)
{
    return component(size.yxx * size.zzy, axis);
}

// Return about the solid angle, in 6 / 2 pi sr at most, of the face of a box across `axis` that looks at x;
// 0 if there is none, or if it lies below the surface.
static inline float face_weight(const BoxView at, float3 low, float3 high, int axis)
{
    const float to_low = component(low - at.x, axis), to_high = component(at.x - high, axis);
    const float gap = fmax(to_low, to_high);
    if (!(gap > 0.0f))
        return 0.0f;
    const float3 size = high - low, half_size = 0.5f * with_component(size, axis, 0.0f);
    float3 middle = 0.5f * (low + high) - at.x;
    middle = with_component(middle, axis, to_low > 0.0f ? gap : -gap);
    if (!(dot(at.n, middle) + dot(fabs(at.n), half_size) > 0.0f))
        return 0.0f;
    const float area = face_area(size, axis);
    const float distance2 = dot(middle, middle);
    return area * gap / (distance2 * sqrt(distance2) + area * gap * (1.0f / 6.0f) + 1e-30f);
}

static inline BoxView view_boxes(__global const float4 *restrict boxes, int count, float3 x, float3 n)
{
    BoxView at = {x, n, 0.0f, 0, 0};
    for (int i = 0; i < count; i++) {
        const float3 low = boxes[2 * i].xyz, high = boxes[2 * i + 1].xyz;
        const float3 middle = 0.5f * (low + high) - x, reach = 0.5f * (high - low);
        at.above |= dot(n, middle) + dot(fabs(n), reach) > 0.0f;
        const float3 beyond = fabs(middle) - reach;
        at.inside |= fmax(beyond.x, fmax(beyond.y, beyond.z)) <= 0.0f;
        for (int axis = 0; axis < 3; axis++)
            at.total += face_weight(at, low, high, axis);
    }
    return at;
}

// Return a unit direction from at.x to a point on a face; u in [0, 1)^2, `choice` in [0, 1). at.total > 0.
static inline float3 sample_boxes(__global const float4 *restrict boxes, int count,
                                  const BoxView at, float2 u, float choice)
{
    float left = choice * at.total;
    int box = -1, face = 0;
    for (int i = 0; i < count && left >= 0.0f; i++)
        for (int axis = 0; axis < 3 && left >= 0.0f; axis++) {
            const float weight = face_weight(at, boxes[2 * i].xyz, boxes[2 * i + 1].xyz, axis);
            // Rounding may leave a remainder: the last face with a weight takes it.
            box = weight > 0.0f ? i : box;
            face = weight > 0.0f ? axis : face;
            left -= weight;
        }
    const float3 low = boxes[2 * box].xyz, high = boxes[2 * box + 1].xyz;
    const float3 at_face = face == 0 ? (float3)(0.0f, u.x, u.y) : face == 1 ? (float3)(u.x, 0.0f, u.y)
                                                                           : (float3)(u.x, u.y, 0.0f);
    const float plane = component(low, face) > component(at.x, face) ? component(low, face)
                                                                     : component(high, face);
    return safe_normalize(with_component(low + at_face * (high - low), face, plane) - at.x, at.n);
}

// Return whether a ray from o along d meets a box.
static inline int meets_boxes(__global const float4 *restrict boxes, int count, float3 o, float3 d)
{
    int met = 0;
    for (int i = 0; i < count; i++) {
        const float3 a = (boxes[2 * i].xyz - o) / d, b = (boxes[2 * i + 1].xyz - o) / d;
        const float3 near = fmin(a, b), far = fmax(a, b);
        const float leave = fmin(far.x, fmin(far.y, far.z));
        met |= leave > 0.0f && fmax(near.x, fmax(near.y, near.z)) <= leave;
    }
    return met;
}

// Return the density per solid angle with which sample_boxes() samples d.
static inline float box_density(__global const float4 *restrict boxes, int count, const BoxView at,
                                float3 d)
{
    float density = 0.0f;
    if (!(at.total > 0.0f))
        return density;
    for (int i = 0; i < count; i++) {
        const float3 low = boxes[2 * i].xyz, high = boxes[2 * i + 1].xyz;
        const float3 a = (low - at.x) / d, b = (high - at.x) / d;
        const float3 near = fmin(a, b), far = fmax(a, b);
        const float enter = fmax(near.x, fmax(near.y, near.z));
        if (!(enter > 0.0f && enter <= fmin(far.x, fmin(far.y, far.z))))
            continue;
        const int axis = enter == near.x ? 0 : enter == near.y ? 1 : 2;
        const float3 size = high - low;
        const float area = face_area(size, axis);
        density += face_weight(at, low, high, axis) * enter * enter
            / (area * fabs(component(d, axis)));
    }
    return density / at.total;
}
