// Mip chain of voxels with opacity and radiance, and tracing of cones through them (C. Crassin et al.,
// "Interactive Indirect Illumination Using Voxel Cone Tracing", Pacific Graphics 2011).
//
// A voxel has an opacity along each axis: the share of parallel rays through it that are blocked. Along
// other directions it has the cross section of the ellipsoid with these three: exact for a flat sheet
// across an axis and for isotropic contents.
#pragma once

#include "maths/equirect.h"
#include "maths/kernel_attributes.h"
#include "world/boxes.h"
#include <iprt.trace.voxels>

// Least height of a sample above the surface that the cone starts from, in voxels: half a voxel of the
// surface itself, and one that interpolation adds.
#define CONE_CLEARANCE 1.5f
// Lower bound of a cone's rise per metre, from which the distance to its start follows.
#define LEAST_RISE 0.05f
// Cones end at this transmittance.
#define CONE_DARK 0.004f
// Bound of the loop: more steps than any diagonal takes.
#define CONE_STEP_CAP 2048
#define CONE_FAR 1e30f

typedef struct {
    float3 o;
    float3 d;
    float slope;   // tangent of half the aperture
    float lift;    // height of o above the surface that must not shadow itself; CONE_FAR: no such surface
    float rise;    // height that the cone gains above that surface per metre
} Cone;

// Result of a cone.
typedef struct {
    float3 radiance;   // attenuated radiance of the voxels beyond `front` metres
    float open;        // likewise, the share that ends at windows, whose voxels emit nothing
    float passed;      // transmittance of the whole cone
    float front;       // transmittance of its part up to `front` metres
    float distance;    // mean distance of the blockers, metres; CONE_FAR: none
} ConeLight;

// Return the tangent of half the aperture of a cone of that solid angle; half the aperture is at most
// 60 degrees.
static inline float cone_slope(float solid_angle)
{
    const float x = fmin(solid_angle * (0.5f / IPRT_PI), 0.5f);
    return sqrt(x * (2.0f - x)) / (1.0f - x);
}

// Four voxels of a layer across an axis, and their weights, which are 0 outside the grid.
typedef struct {
    int a, b, below_a, below_b;
    float4 weights;
} VoxelTaps;

// Return v with its axes rotated so that `axis` comes last.
static inline float3 axis_last(float3 v, int axis)
{
    return axis == 0 ? v.yzx : axis == 1 ? v.zxy : v;
}

static inline int3 axis_last_int(int3 v, int axis)
{
    return axis == 0 ? v.yzx : axis == 1 ? v.zxy : v;
}

// Return the taps around `at`, in voxels of the level, in the layer across the axis that contains it.
static inline VoxelTaps voxel_taps(int4 level, int axis, float3 at)
{
    const int3 size = axis_last_int(level.xyz, axis);
    const int3 stride = axis_last_int((int3)(1, level.x, level.x * level.y), axis);
    const float3 place = clamp(axis_last(at, axis) - (float3)(0.5f, 0.5f, 0.0f), -1.0f,
                               convert_float3(size));
    const float3 low = floor(place);
    const float2 part = (place - low).xy;
    const int3 cell = convert_int3(low), last = size - 1;
    const int there = cell.z >= 0 && cell.z <= last.z;
    const float2 near = (float2)(cell.x >= 0 && cell.x <= last.x ? 1.0f - part.x : 0.0f,
                                 cell.y >= 0 && cell.y <= last.y ? 1.0f - part.y : 0.0f);
    const float2 far = (float2)(cell.x >= -1 && cell.x < last.x ? part.x : 0.0f,
                                cell.y >= -1 && cell.y < last.y ? part.y : 0.0f);
    const int3 a = clamp(cell, (int3)(0), last), b = clamp(cell + 1, (int3)(0), last);
    const int layer = level.w + stride.z * a.z;
    VoxelTaps taps;
    taps.a = layer + stride.x * a.x + stride.y * a.y;
    taps.b = layer + stride.x * b.x + stride.y * a.y;
    taps.below_a = layer + stride.x * a.x + stride.y * b.y;
    taps.below_b = layer + stride.x * b.x + stride.y * b.y;
    taps.weights = there ? (float4)(near.x * near.y, far.x * near.y, near.x * far.y, far.x * far.y)
                         : (float4)(0.0f);
    return taps;
}

static inline float4 blend_voxels(__global const float4 *voxels, const VoxelTaps taps)
{
    return taps.weights.x * voxels[taps.a] + taps.weights.y * voxels[taps.b]
        + taps.weights.z * voxels[taps.below_a] + taps.weights.w * voxels[taps.below_b];
}

// Return the level for a cone at `t` metres. Its voxels are at most a quarter of the cone's width, as
// layers of wider ones that cover the same part of it would add up. Their clearance from the surface that
// the cone starts from limits them, too.
static inline int cone_level(const Voxels voxels, const Cone cone, float t)
{
    const float wide = fmin(0.5f * cone.slope * t, (cone.lift + cone.rise * t) / CONE_CLEARANCE);
    // The exponent of a float is its binary logarithm, rounded down.
    return min((int)(as_uint(fmax(wide / voxels.box.w, 1.0f)) >> 23) - 127, voxels.count - 1);
}

// Return the centre of voxel i of a level of that size.
static inline float3 voxel_middle(int4 size, float4 box, int i)
{
    return box.xyz
        + box.w * ((float3)(i % size.x, i / size.x % size.y, i / (size.x * size.y)) + 0.5f);
}

// Return the distances at which a cone's axis enters and leaves the box, enlarged by the cone's radius.
static inline float2 cone_span(const Voxels voxels, const Cone cone)
{
    const float3 reach = 0.5f * voxels.box.w * convert_float3(voxels.levels[0].xyz);
    const float3 middle = voxels.box.xyz + reach - cone.o;
    const float3 wide = reach + cone.slope * length(middle);
    const float3 d = copysign(fmax(fabs(cone.d), 1e-12f), cone.d);
    const float3 a = (middle - wide) / d, b = (middle + wide) / d;
    const float3 near = fmin(a, b), far = fmax(a, b);
    return (float2)(fmax(near.x, fmax(near.y, near.z)), fmin(far.x, fmin(far.y, far.z)));
}

// Trace a cone front to back from `start` metres on, layer by layer across the axis closest to its direction.
// Each layer is sampled once, in its middle, so that a closed layer is opaque. Voxels closer than `front`
// metres occlude but do not emit. `lit` 0: no voxel emits.
static inline ALWAYS_INLINE ConeLight trace_cone(
    const Voxels voxels, const Cone cone, float start, float front, int lit)
{
    ConeLight found = {(float3)(0.0f), 0.0f, 1.0f, 1.0f, CONE_FAR};
    const float2 span = cone_span(voxels, cone);
    const float3 size = fabs(cone.d);
    const int axis = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
    const float along = component(cone.d, axis), sense = along < 0.0f ? -1.0f : 1.0f;
    // In voxels of the finest level, along the axis in the sense of the cone: its start, and its pace per metre.
    const float3 from = (cone.o - voxels.box.xyz) / voxels.box.w;
    const float begin = sense * component(from, axis), pace = fabs(along) / voxels.box.w;
    const float first = fmax(start, span.x);
    const int coarse = 1 << cone_level(voxels, cone, first);
    int layer = coarse * (int)ceil((begin + first * pace) / coarse - 0.5f);
    float stopped_at = 0.0f;
    for (int step = 0; step < CONE_STEP_CAP && found.passed > CONE_DARK; step++) {
        // Layers of coarse levels begin at multiples of their width.
        const int aligned = popcount((layer & -layer) - 1);
        const int level = min(aligned, cone_level(voxels, cone, fmax((layer - begin) / pace, 0.0f)));
        const int width = 1 << level;
        // The last layer may begin inside the box and have its middle outside.
        if (!((layer - begin) / pace < span.y))
            break;
        const float at = (layer + 0.5f * width - begin) / pace;
        layer += width;
        const VoxelTaps taps = voxel_taps(voxels.levels[level], axis,
                                          (from + at / voxels.box.w * cone.d) / (float)width);
        const float4 opacity = blend_voxels(voxels.opacity, taps);
        // Share of the layer that the voxels' cross sections cover, seen along the cone.
        const float3 across = opacity.xyz * cone.d;
        const float blocked = fmin(sqrt(dot(across, across)) / fabs(along), 1.0f);
        if (blocked > 0.0f) {
            const float stopped = found.passed * blocked;
            if (lit && at >= front) {
                const float4 light = blend_voxels(voxels.light, taps);
                const float share = light.w > 0.0f ? stopped / light.w : 0.0f;
                found.radiance += share * light.xyz;
                found.open += share * opacity.w;
            }
            stopped_at += stopped * at;
            found.passed -= stopped;
            found.front = at < front ? found.passed : found.front;
        }
    }
    if (found.passed < 1.0f)
        found.distance = stopped_at / (1.0f - found.passed);
    return found;
}

// Return 1 if the box of the voxels reaches above the surface at p with normal n, else 0.
static inline int voxels_above(const Voxels voxels, float3 p, float3 n)
{
    const float3 reach = 0.5f * voxels.box.w * convert_float3(voxels.levels[0].xyz);
    return dot(n, voxels.box.xyz + reach - p) + dot(fabs(n), reach) > 0.0f;
}
