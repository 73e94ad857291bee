// Ray tracing of a two-level bounding volume hierarchy: a tree over instances, whose leaves are trees over
// triangles in object space (iprt/bvh/). Finds the nearest hit, front to back, with a short stack.
//
// Boxes:     slabs, four at once, made conservative after T. Ize, "Robust BVH Ray Traversal",
//            JCGT 2(2), 2013.
// Triangles: S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013,
//            four at once. No ray slips between triangles that share vertices.
//
//   nodes      BVH_NODE_ROWS float4 per node, a column per child: low x, high x, low y, high y,
//              low z, high z of its box, inverted where there is no child; then references as int
//              bits: a node, or ~leaf. Nodes of the tree over instances come first: node 0 is its
//              root, its leaves are instances. Leaves of the other trees are packets.
//   packets    BVH_PACKET_ROWS float4 per packet, a column per triangle: x, y, z of the first
//              corner, the second, the third; NaN where there is no triangle.
//   instances  BVH_INSTANCE_ROWS float4 per instance: 3 rows object from world; 3 rows world from
//              object; then as int bits: reference of its root, first material.
#pragma once

#include "maths/work_counters.h"
#include <iprt.world.objects.object_bvh>

#ifdef OBJECTS_BVH

// -D BVH_STACK: three entries for each level of both trees, whose depth the host bounds
// (iprt/bvh/build.py). A level leaves at most three children on the stack.
#define BVH_NODE_ROWS 7
#define BVH_PACKET_ROWS 9
#define BVH_INSTANCE_ROWS 7

// Steps after which a ray keeps its current hit: a hundred times more than any ray needs in a valid tree. A
// corrupt buffer thus cannot hang the kernel.
#ifndef BVH_STEP_CAP
#define BVH_STEP_CAP 65536
#endif

typedef struct {
    float t;
    int instance;
    int triangle;        // 4 packet + column
    float u, v;          // weights of the second and third corner
} BvhHit;

// A ray in the space of the current tree.
typedef struct {
    float3 o;
    float3 inverse;      // of the direction, finite
    float3 sheared;      // Sx, Sy, Sz of Woop et al., section 3.1
    int kx, ky, kz;
} BvhRay;

// Return the components kx, ky, kz of v, by swizzles: compilers for GPUs put vectors with indexed
// components on the stack.
static inline float3 bvh_permuted(float3 v, int kz)
{
    return kz == 2 ? v : kz == 1 ? v.zxy : v.yzx;
}

static inline BvhRay bvh_ray(float3 o, float3 d)
{
    BvhRay ray;
    const float3 size = fabs(d);
    ray.kz = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
    ray.kx = ray.kz == 2 ? 0 : ray.kz + 1;
    ray.ky = ray.kx == 2 ? 0 : ray.kx + 1;
    ray.o = o;
    const float3 permuted = bvh_permuted(d, ray.kz);
    ray.sheared.z = 1.0f / permuted.z;
    ray.sheared.xy = permuted.xy * ray.sheared.z;
    // Bounds the inverse of a component near 0, so that 0 is never multiplied by infinity.
    const float least = 1e-18f * fabs(permuted.z);
    ray.inverse.x = 1.0f / (size.x > least ? d.x : copysign(least, d.x));
    ray.inverse.y = 1.0f / (size.y > least ? d.y : copysign(least, d.y));
    ray.inverse.z = 1.0f / (size.z > least ? d.z : copysign(least, d.z));
    return ray;
}

#define BVH_NO_CHILD 0x7f800000

// Return where the ray enters the four boxes of a node: the distance as int bits, the last two replaced by
// the column, so that children can be sorted as integers; BVH_NO_CHILD for boxes not entered before t_max.
static inline int4 bvh_enter(__global const float4 *node, const BvhRay ray, float t_max)
{
    const int x = ray.inverse.x < 0.0f, y = ray.inverse.y < 0.0f, z = ray.inverse.z < 0.0f;
    const float4 x0 = (node[x] - ray.o.x) * ray.inverse.x;
    const float4 x1 = (node[1 - x] - ray.o.x) * ray.inverse.x;
    const float4 y0 = (node[2 + y] - ray.o.y) * ray.inverse.y;
    const float4 y1 = (node[3 - y] - ray.o.y) * ray.inverse.y;
    const float4 z0 = (node[4 + z] - ray.o.z) * ray.inverse.z;
    const float4 z1 = (node[5 - z] - ray.o.z) * ray.inverse.z;
    // Comparisons rather than fmin and fmax, which take several instructions to handle NaN.
    const float4 positive = z0 > 0.0f ? z0 : (float4)(0.0f);
    const float4 xy0 = x0 > y0 ? x0 : y0, xy1 = x1 < y1 ? x1 : y1;
    const float4 enter = xy0 > positive ? xy0 : positive;
    float4 leave = (xy1 < z1 ? xy1 : z1) * 1.0000004f;
    leave = leave < t_max ? leave : (float4)(t_max);
    return enter <= leave ? (as_int4(enter) & ~3) | (int4)(0, 1, 2, 3) : (int4)(BVH_NO_CHILD);
}

static inline float bvh_column(float4 v, int column)
{
    const float2 half_of = column & 2 ? v.zw : v.xy;
    return column & 1 ? half_of.y : half_of.x;
}

// Find the nearest hit among the four triangles of a packet, if nearer than hit->t.
static inline int bvh_packet(const Bvh bvh, const BvhRay ray, int packet, BvhHit *hit)
{
// The edge functions of adjacent triangles must be each other's negative, bit for bit.
#pragma OPENCL FP_CONTRACT OFF
    __global const float4 *a = bvh.packets + BVH_PACKET_ROWS * packet, *b = a + 3, *c = a + 6;
    const float3 o = bvh_permuted(ray.o, ray.kz);
    const float4 az = a[ray.kz] - o.z, bz = b[ray.kz] - o.z, cz = c[ray.kz] - o.z;
    const float4 ax = (a[ray.kx] - o.x) - ray.sheared.x * az;
    const float4 bx = (b[ray.kx] - o.x) - ray.sheared.x * bz;
    const float4 cx = (c[ray.kx] - o.x) - ray.sheared.x * cz;
    const float4 ay = (a[ray.ky] - o.y) - ray.sheared.y * az;
    const float4 by = (b[ray.ky] - o.y) - ray.sheared.y * bz;
    const float4 cy = (c[ray.ky] - o.y) - ray.sheared.y * cz;
    const float4 u = cx * by - cy * bx, v = ax * cy - ay * cx, w = bx * ay - by * ax;
    const int4 inside = ((u >= 0.0f) & (v >= 0.0f) & (w >= 0.0f))
        | ((u <= 0.0f) & (v <= 0.0f) & (w <= 0.0f));
    if (!(inside.x | inside.y | inside.z | inside.w))
        return 0;
    // NaN where all edge functions vanish: degenerate triangles and triangles seen edge-on.
    const float4 sum = u + v + w;
    const float4 t = (u * az + v * bz + w * cz) * ray.sheared.z / sum;
    const int4 nearer = inside & (t > 0.0f) & (t < hit->t);
    const int4 bits = nearer ? as_int4(t) : (int4)(BVH_NO_CHILD);
    const int nearest = min(min(bits.x, bits.y), min(bits.z, bits.w));
    if (nearest == BVH_NO_CHILD)
        return 0;
    const int column = nearest == bits.x ? 0 : nearest == bits.y ? 1 : nearest == bits.z ? 2 : 3;
    const float4 inverse = 1.0f / sum;
    hit->t = as_float(nearest);
    hit->triangle = 4 * packet + column;
    hit->u = bvh_column(v * inverse, column);
    hit->v = bvh_column(w * inverse, column);
    return 1;
}

static inline float3 bvh_transform(__global const float4 *rows, float3 v, float w)
{
    const float4 p = (float4)(v, w);
    return (float3)(dot(rows[0], p), dot(rows[1], p), dot(rows[2], p));
}

// Find the nearest triangle along o + t d with 0 < t < t_max. Returns 1 if there is one. o and d must be
// finite, and d not 0.
static inline int bvh_trace(const Bvh bvh, float3 o, float3 d, float t_max, BvhHit *hit)
{
    COUNT_RAY(bvh.work, WORK_OBJECTS);
    if (bvh.count == 0)
        return 0;
    int2 stack[BVH_STACK];     // reference, key of bvh_enter
    int top = 0, upper = 0, instance = -1, met = 0;
    int reference = bvh.count == 1 ? ~0 : 0;
    hit->t = t_max;
    BvhRay ray = bvh_ray(o, d);
    for (int step = 0; step < BVH_STEP_CAP; step++) {
        if (reference >= 0) {
            __global const float4 *node = bvh.nodes + BVH_NODE_ROWS * reference;
            __global const int *references = (__global const int *)(node + 6);
            const int4 key = bvh_enter(node, ray, hit->t);
            const int a = min(key.x, key.y), b = max(key.x, key.y);
            const int c = min(key.z, key.w), e = max(key.z, key.w);
            const int first = min(a, c), middle = max(a, c), other = min(b, e), last = max(b, e);
            const int second = min(middle, other), third = max(middle, other);
            if (first != BVH_NO_CHILD) {
                if (last != BVH_NO_CHILD)
                    stack[top++] = (int2)(references[last & 3], last);
                if (third != BVH_NO_CHILD)
                    stack[top++] = (int2)(references[third & 3], third);
                if (second != BVH_NO_CHILD)
                    stack[top++] = (int2)(references[second & 3], second);
                reference = references[first & 3];
                continue;
            }
        } else if (instance < 0) {
            instance = ~reference;
            __global const float4 *rows = bvh.instances + BVH_INSTANCE_ROWS * instance;
            ray = bvh_ray(bvh_transform(rows, o, 1.0f), bvh_transform(rows, d, 0.0f));
            reference = as_int(rows[6].x);
            upper = top;
            continue;
        } else if (bvh_packet(bvh, ray, ~reference, hit)) {
            hit->instance = instance;
            met = 1;
        }
        do {
            if (top == 0) {
                COUNT_STEPS(bvh.work, WORK_OBJECTS, step + 1);
                return met;
            }
            if (instance >= 0 && top == upper) {
                instance = -1;
                ray = bvh_ray(o, d);
            }
            top--;
        } while (as_float(stack[top].y & ~3) >= hit->t);
        reference = stack[top].x;
    }
    COUNT_STEPS(bvh.work, WORK_OBJECTS, BVH_STEP_CAP);
    return met;
}

#endif
