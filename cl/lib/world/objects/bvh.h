// Ray tracing of a two-level bounding volume hierarchy: a tree over instances, whose leaves are trees over
// triangles in object space (iprt/bvh/). Finds the nearest hit, front to back, with a short stack.
//
// Boxes:     slabs, made conservative after T. Ize, "Robust BVH Ray Traversal", JCGT 2(2), 2013. They are
//            quantised as in H. Ylitie, T. Karras, S. Laine, "Efficient Incoherent Ray Traversal on GPUs
//            Through Compressed Wide BVHs", HPG 2017.
// Triangles: S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013. No ray
//            slips between triangles that share vertices.
//
//   nodes      BVH_NODE_ROWS float4 per node, two lines of a cache: the lowest corner of its eight
//              children's boxes, and a step along each axis, as floats; low x, high x, low y, high y, low z,
//              high z of each child in steps from the corner, as bytes; in the last two rows the children's
//              references as ints: a node, ~leaf, or INT_MIN for none. Nodes of the tree over instances come
//              first: node 0 is its root, its leaves are instances. Leaves of the other trees are packets.
//   packets    BVH_PACKET_ROWS float4 per packet, a column per triangle: x, y, z of the first
//              corner, the second, the third; NaN where there is no triangle.
//   instances  BVH_INSTANCE_ROWS float4 per instance: 3 rows object from world; 3 rows world from
//              object; then as int bits: reference of its root, first material.
#pragma once

#include "maths/work_counters.h"
#include <iprt.world.objects.object_bvh>

#ifdef OBJECTS_BVH

// -D BVH_STACK: an entry for each level of both trees, whose depth the host bounds (iprt/bvh/build.py).
// -D BVH_SCALAR: as on GPUs, one child and one triangle after another, which takes few registers. CPUs take
// eight children and four triangles at once.
#if defined(__x86_64__) || defined(__aarch64__)
#define BVH_ON_CPU
#elif defined(__has_attribute)
#if __has_attribute(intel_vec_len_hint)
#define BVH_ON_CPU
#endif
#endif
#if defined(BVH_ON_CPU) && !defined(BVH_SCALAR)
#define BVH_WIDE
#endif

#define BVH_NODE_ROWS 8
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
    float3 inverse;      // of the direction, finite
#ifdef BVH_WIDE
    float3 start;        // inverse times the origin
    float3 o;            // the origin's components kx, ky, kz
    int kx, ky;
    int x_near, y_near, z_near;   // place in a node of the planes that the ray meets first
#else
    float3 o;            // the origin; the rest is computed again where it is needed, to save registers
#endif
    float3 sheared;      // Sx, Sy, Sz of Woop et al., section 3.1
    int kz;
} BvhRay;

// Return the components kx, ky, kz of v. CPUs would mispredict branches, and GPUs would put indexed components
// on the stack.
static inline float3 bvh_permuted(float3 v, int kz)
{
    return select(select(v.yzx, v.zxy, (int3)(-(kz == 1))), v, (int3)(-(kz == 2)));
}

static inline int bvh_next_axis(int axis) { return axis == 2 ? 0 : axis + 1; }

static inline BvhRay bvh_ray(float3 o, float3 d)
{
    BvhRay ray;
    const float3 size = fabs(d);
    ray.kz = size.z >= fmax(size.x, size.y) ? 2 : size.x <= size.y;
    const float3 permuted = bvh_permuted(d, ray.kz);
    ray.sheared.z = 1.0f / permuted.z;
    ray.sheared.xy = permuted.xy * ray.sheared.z;
    // Bounds the inverse of a component near 0, so that 0 is never multiplied by infinity.
    const float least = 1e-18f * fabs(permuted.z);
    ray.inverse = 1.0f / select(copysign((float3)(least), d), d, size > least);
#ifdef BVH_WIDE
    ray.start = ray.inverse * o;
    ray.x_near = ray.inverse.x < 0.0f ? 1 : 0;
    ray.y_near = ray.inverse.y < 0.0f ? 3 : 2;
    ray.z_near = ray.inverse.z < 0.0f ? 5 : 4;
    ray.kx = bvh_next_axis(ray.kz);
    ray.ky = bvh_next_axis(ray.kx);
    ray.o = bvh_permuted(o, ray.kz);
#else
    ray.o = o;
#endif
    return ray;
}

// Lengthens the way through a box by the error of the distances to its planes. Errors in proportion to
// the box's coordinates are in its padding (iprt/bvh/build.py).
#define BVH_ROUNDING 1.000001f
#define BVH_NO_CHILD 0x7f800000

// The children of a node that a ray enters before t_max. `first` is BVH_NO_CHILD if there are none, else the
// column of the nearest is in its last three bits.
typedef struct {
    int first;
    int rest;            // the other children, in the format of bvh_enter()
} BvhEntered;

#ifdef BVH_WIDE

// Return the distances to eight planes, at steps from where the ray meets the corner of a node.
static inline float8 bvh_planes(__global const ulong *steps, float step, float corner)
{
    return fma(convert_float8(as_uchar8(*steps)), step, corner);
}

#define BVH_EXCHANGED(KEY, OTHER, ...) ((int8)(__VA_ARGS__) ? max(KEY, KEY.OTHER) : min(KEY, KEY.OTHER))

// Return keys in ascending order, by a bitonic network.
static inline int8 bvh_sorted(int8 key)
{
    key = BVH_EXCHANGED(key, s10325476, 0, -1, 0, -1, 0, -1, 0, -1);
    key = BVH_EXCHANGED(key, s32107654, 0, 0, -1, -1, 0, 0, -1, -1);
    key = BVH_EXCHANGED(key, s10325476, 0, -1, 0, -1, 0, -1, 0, -1);
    key = BVH_EXCHANGED(key, s76543210, 0, 0, 0, 0, -1, -1, -1, -1);
    key = BVH_EXCHANGED(key, s23016745, 0, 0, -1, -1, 0, 0, -1, -1);
    return BVH_EXCHANGED(key, s10325476, 0, -1, 0, -1, 0, -1, 0, -1);
}

#define BVH_COUNT 21

// Find the children that a ray enters. `rest` holds the columns of all but the nearest, the next one in its
// last three bits, and their number from bit BVH_COUNT on.
static inline BvhEntered bvh_enter(__global const float4 *node, const BvhRay ray, float t_max)
{
    __global const float *corner = (__global const float *)node, *size = corner + 3;
    __global const ulong *bounds = (__global const ulong *)(corner + 6);
    const float x = fma(corner[0], ray.inverse.x, -ray.start.x), x_step = size[0] * ray.inverse.x;
    const float y = fma(corner[1], ray.inverse.y, -ray.start.y), y_step = size[1] * ray.inverse.y;
    const float z = fma(corner[2], ray.inverse.z, -ray.start.z), z_step = size[2] * ray.inverse.z;
    const float8 x0 = bvh_planes(bounds + ray.x_near, x_step, x);
    const float8 x1 = bvh_planes(bounds + (1 - ray.x_near), x_step, x);
    const float8 y0 = bvh_planes(bounds + ray.y_near, y_step, y);
    const float8 y1 = bvh_planes(bounds + (5 - ray.y_near), y_step, y);
    const float8 z0 = bvh_planes(bounds + ray.z_near, z_step, z);
    const float8 z1 = bvh_planes(bounds + (9 - ray.z_near), z_step, z);
    // Comparisons rather than fmin and fmax, which take several instructions to handle NaN.
    const float8 positive = z0 > 0.0f ? z0 : (float8)(0.0f);
    const float8 xy0 = x0 > y0 ? x0 : y0, xy1 = x1 < y1 ? x1 : y1;
    const float8 enter = xy0 > positive ? xy0 : positive;
    float8 leave = (xy1 < z1 ? xy1 : z1) * BVH_ROUNDING;
    leave = leave < t_max ? leave : (float8)(t_max);
    const int8 met = (enter <= leave) & (*(__global const int8 *)(node + 6) != INT_MIN);
    // Distances as int bits, the last three replaced by the column, so that they can be sorted as integers.
    const int8 key =
        met ? (as_int8(enter) & ~7) | (int8)(0, 1, 2, 3, 4, 5, 6, 7) : (int8)(BVH_NO_CHILD);
    const int4 four = min(key.lo, key.hi);
    const int2 two = min(four.lo, four.hi);
    const int8 sorted = bvh_sorted(key);
    int8 rest = (sorted & 7) << (int8)(0, 0, 3, 6, 9, 12, 15, 18);
    rest |= sorted != BVH_NO_CHILD ? (int8)(1 << BVH_COUNT) : (int8)(0);
    rest.s0 = 0;
    const int4 in_four = rest.lo + rest.hi;
    const int2 in_two = in_four.lo + in_four.hi;
    const BvhEntered entered = {min(two.x, two.y), in_two.x + in_two.y};
    return entered;
}

#else

// Find the children that a ray enters. `rest` is a mask of the columns of all but the nearest.
static inline BvhEntered bvh_enter(__global const float4 *node, const BvhRay ray, float t_max)
{
    const float4 row0 = node[0], row1 = node[1];
    const float3 corner = (row0.xyz - ray.o) * ray.inverse;
    const float3 size = (float3)(row0.w, row1.xy) * ray.inverse;
    // Rays meet low planes first, unless they run against the axis.
    const int x_near = ray.inverse.x < 0.0f ? 2 : 0, y_near = ray.inverse.y < 0.0f ? 6 : 4;
    const int z_near = ray.inverse.z < 0.0f ? 10 : 8;
    __global const int *references = (__global const int *)(node + 6);
    BvhEntered entered = {BVH_NO_CHILD, 0};
#pragma unroll 1
    for (int half_of = 0; half_of < 2; half_of++) {
        __global const uint *word = (__global const uint *)node + 6 + half_of;
        uint xa = word[x_near], xb = word[2 - x_near], ya = word[y_near], yb = word[10 - y_near];
        uint za = word[z_near], zb = word[18 - z_near];
#pragma unroll 1
        for (int column = 4 * half_of; column < 4 * half_of + 4; column++) {
            const float x0 = fma((float)(xa & 255u), size.x, corner.x);
            const float x1 = fma((float)(xb & 255u), size.x, corner.x);
            const float y0 = fma((float)(ya & 255u), size.y, corner.y);
            const float y1 = fma((float)(yb & 255u), size.y, corner.y);
            const float z0 = fma((float)(za & 255u), size.z, corner.z);
            const float z1 = fma((float)(zb & 255u), size.z, corner.z);
            xa >>= 8, xb >>= 8, ya >>= 8, yb >>= 8, za >>= 8, zb >>= 8;
            const float enter = fmax(fmax(x0, y0), fmax(z0, 0.0f));
            const float leave = fmin(fmin(x1, y1), z1) * BVH_ROUNDING;
            if (!(enter <= fmin(leave, t_max)) || references[column] == INT_MIN)
                continue;
            entered.first = min(entered.first, (as_int(enter) & ~7) | column);
            entered.rest |= 1 << column;
        }
    }
    entered.rest &= ~(1 << (entered.first & 7));
    return entered;
}

#endif

#include "world/objects/bvh_packet.h"

static inline float3 bvh_transform(__global const float4 *rows, float3 v, float w)
{
    const float4 p = (float4)(v, w);
    return (float3)(dot(rows[0], p), dot(rows[1], p), dot(rows[2], p));
}

// Fetches the next node of the stack into the cache while the ray is below the nearest child. Nothing
// happens where the address is not valid.
#if defined(BVH_WIDE) && defined(__has_builtin)
#if __has_builtin(__builtin_prefetch)
static inline void bvh_prefetch(const Bvh bvh, int reference)
{
    const ulong at = reference >= 0 ? (ulong)(bvh.nodes + BVH_NODE_ROWS * reference)
                                    : (ulong)(bvh.packets + BVH_PACKET_ROWS * ~reference);
    __builtin_prefetch((const void *)at);
    __builtin_prefetch((const void *)(at + 64));
    __builtin_prefetch((const void *)(at + 128));
}
#define BVH_PREFETCH(bvh, reference) bvh_prefetch(bvh, reference)
#endif
#endif
#ifndef BVH_PREFETCH
#define BVH_PREFETCH(bvh, reference)
#endif

static inline int bvh_reference(const Bvh bvh, int node, int column)
{
    return ((__global const int *)(bvh.nodes + BVH_NODE_ROWS * node + 6))[column];
}

// A node, and its children that the ray still has to visit, in the format of bvh_enter().
#ifdef BVH_WIDE

typedef uint2 BvhBack;

static inline BvhBack bvh_back(int node, int rest) { return (uint2)(node, rest); }

static inline int bvh_is_left(BvhBack back) { return back.y >= 1u << BVH_COUNT; }

// Take out the next child and return its reference.
static inline int bvh_next(const Bvh bvh, BvhBack *back)
{
    const uint columns = (1u << BVH_COUNT) - 1u, before = back->y;
    back->y = (before & columns) >> 3 | ((before & ~columns) - (1u << BVH_COUNT));
    return bvh_reference(bvh, back->x, before & 7);
}

#else

typedef uint BvhBack;

static inline BvhBack bvh_back(int node, int rest) { return (uint)node << 8 | rest; }

static inline int bvh_is_left(BvhBack back) { return (back & 255u) != 0; }

static inline int bvh_next(const Bvh bvh, BvhBack *back)
{
    const int column = 31 - (int)clz(*back & 255u);
    *back &= ~(1u << column);
    return bvh_reference(bvh, *back >> 8, column);
}

#endif

// Find the nearest triangle along o + t d with 0 < t < t_max, or, with `any`, one of them. Returns 1 if there
// is one. o and d must be finite, and d not 0.
static inline int bvh_trace(const Bvh bvh, float3 o, float3 d, float t_max, int any, BvhHit *hit)
{
    COUNT_RAY(bvh.work, WORK_OBJECTS);
    if (bvh.count == 0)
        return 0;
    BvhBack stack[BVH_STACK];
    int top = 0, upper = 0, met = 0;
    int instance = -1;
    int reference = 0;
    hit->t = t_max;
    BvhRay ray;
    if (bvh.count == 1) {
        instance = 0;
        ray = bvh_ray(bvh_transform(bvh.instances, o, 1.0f), bvh_transform(bvh.instances, d, 0.0f));
        reference = as_int(bvh.instances[6].x);
    } else
        ray = bvh_ray(o, d);
    for (int step = 0; step < BVH_STEP_CAP; step++) {
        if (reference >= 0) {
            __global const float4 *node = bvh.nodes + BVH_NODE_ROWS * reference;
            const BvhEntered entered = bvh_enter(node, ray, hit->t);
            if (entered.first != BVH_NO_CHILD) {
                stack[top] = bvh_back(reference, entered.rest);
                top += bvh_is_left(stack[top]);
                BVH_PREFETCH(bvh, bvh_reference(bvh, reference, entered.rest & 7));
                reference = bvh_reference(bvh, reference, entered.first & 7);
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
            top = any ? 0 : top;
        }
        if (top == 0) {
            COUNT_STEPS(bvh.work, WORK_OBJECTS, step + 1);
            return met;
        }
        if (instance >= 0 && top == upper) {
            instance = -1;
            ray = bvh_ray(o, d);
        }
        BvhBack back = stack[--top];
        reference = bvh_next(bvh, &back);
        stack[top] = back;
        top += bvh_is_left(back);
    }
    COUNT_STEPS(bvh.work, WORK_OBJECTS, BVH_STEP_CAP);
    return met;
}

#endif
