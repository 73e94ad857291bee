// The virtual objects as rays see them: triangles in a bounding volume hierarchy.
#pragma once

#include "world/objects/bvh.h"
#include "maths/kernel_attributes.h"
#include "maths/grid.h"
#include "maths/maths.h"
#include "world/objects/scatterer.h"

#ifdef OBJECTS_BVH

// Offset of rays above a surface, as a fraction of the largest coordinate involved. A hit, computed from
// the triangle's corners, and the ray's start in object space are each a few units in the last place
// (2^-24) of that coordinate off the plane. After C. Wächter and N. Binder, "A Fast and Robust Method for
// Avoiding Self-Intersection", Ray Tracing Gems, 2019, but the same in all directions, so that it does not
// depend on the unit of length.
#define OBJECT_ULPS 0x1p-18f
// The same for surfaces in the view, whose position comes from a depth picture.
#define OBJECT_DEPTH_ERROR 0x1p-14f

typedef BvhHit ObjectHit;

static inline ALWAYS_INLINE int trace_objects(
    const Objects world, float3 o, float3 d, float t_max, int any, ObjectHit *hit)
{
    return is_ray(o, d) && bvh_trace(world.bvh, o, d, t_max, any, hit);
}

// Return the bilinear value of a repeated texture; row 0 is at v = 1.
static inline float3 object_texture(__global const half *texels, int4 image, float2 uv)
{
    const float2 at = (uv - floor(uv)) * (float2)(image.y, -image.z) - 0.5f;
    const float2 low = floor(at), part = at - low;
    int x = (int)low.x, y = (int)low.y + image.z;
    x = clamp(x < 0 ? x + image.y : x, 0, image.y - 1);
    y = clamp(y < 0 ? y + image.z : y, 0, image.z - 1);
    const int right = x + 1 < image.y ? x + 1 : 0, below = y + 1 < image.z ? y + 1 : 0;
    const int row0 = image.x + y * image.y, row1 = image.x + below * image.y;
    const float4 upper = mix(vload_half4(row0 + x, texels), vload_half4(row0 + right, texels), part.x);
    const float4 lower = mix(vload_half4(row1 + x, texels), vload_half4(row1 + right, texels), part.x);
    return mix(upper, lower, part.y).xyz;
}

// Return a material's albedo at barycentric weights of a triangle; `material` counts all instances'.
static inline float3 object_albedo(const Objects world, int material, int4 vertices, float3 weights)
{
    float3 albedo = world.bvh.albedos[2 * material].xyz;
    const int4 image = as_int4(world.bvh.albedos[2 * material + 1]);
    if (image.y > 0) {
        const float2 uv = weights.x * world.bvh.uvs[vertices.x] + weights.y * world.bvh.uvs[vertices.y]
            + weights.z * world.bvh.uvs[vertices.z];
        albedo *= object_texture(world.bvh.texels, image, uv);
    }
    return albedo;
}

static inline float3 packet_corner(__global const float4 *rows, int corner, int column)
{
    __global const float *x = (__global const float *)(rows + 3 * corner) + column;
    return (float3)(x[0], x[4], x[8]);
}

// Return the unit normal in world space, by the inverse transpose of world from object.
static inline float3 vertex_normal(const Objects world, __global const float4 *rows, int vertex)
{
    const float3 n = world.bvh.normals[vertex].xyz;
    return safe_normalize(n.x * rows[0].xyz + n.y * rows[1].xyz + n.z * rows[2].xyz,
                          (float3)(0.0f));
}

static inline float largest(float3 v)
{
    return fmax(fabs(v.x), fmax(fabs(v.y), fabs(v.z)));
}

// Return the index, among all instances' materials, of the one that a ray has hit.
static inline ALWAYS_INLINE int object_material(const Objects world, const ObjectHit hit)
{
    __global const float4 *rows = world.bvh.instances + BVH_INSTANCE_ROWS * hit.instance;
    return as_int(rows[6].y) + world.bvh.triangles[hit.triangle].w;
}

// The triangle that a ray along d has hit, in world space.
typedef struct {
    float3 position;
    float3 flat_normal;   // of the plane, towards the viewer
    float3 normal;        // interpolated, outward in the mesh; flat_normal without normals
    float3 bulge;         // from position to the curved surface implied by the normals, if outside
    float reach;          // the largest coordinate in its computation
    int4 vertices;        // w: the material of the mesh
    float3 weights;
    int material;         // index among all instances' materials
} ObjectSurface;

// Return the offset from x up to the plane through the origin with normal n, 0 if x is above it.
static inline float3 above_plane(float3 x, float3 n) { return fmax(-dot(x, n), 0.0f) * n; }

static inline ALWAYS_INLINE ObjectSurface object_surface(const Objects world, const ObjectHit hit, float3 d)
{
    __global const float4 *rows = world.bvh.instances + BVH_INSTANCE_ROWS * hit.instance;
    __global const float4 *packet = world.bvh.packets + BVH_PACKET_ROWS * (hit.triangle >> 2);
    const int column = hit.triangle & 3;
    const float3 a = bvh_transform(rows + 3, packet_corner(packet, 0, column), 1.0f);
    const float3 b = bvh_transform(rows + 3, packet_corner(packet, 1, column), 1.0f);
    const float3 c = bvh_transform(rows + 3, packet_corner(packet, 2, column), 1.0f);
    const float3 moved = (float3)(rows[3].w, rows[4].w, rows[5].w);
    ObjectSurface at;
    at.vertices = world.bvh.triangles[hit.triangle];
    at.material = object_material(world, hit);
    at.weights = (float3)(1.0f - hit.u - hit.v, hit.u, hit.v);
    at.position = at.weights.x * a + at.weights.y * b + at.weights.z * c;
    at.reach = fmax(fmax(largest(a), largest(b)), fmax(largest(c), largest(moved)));
    at.flat_normal =
        safe_normalize(cross(safe_normalize(b - a, d), safe_normalize(c - a, d)), -d);
    at.flat_normal = dot(at.flat_normal, d) > 0.0f ? -at.flat_normal : at.flat_normal;
    const float3 na = vertex_normal(world, rows, at.vertices.x);
    const float3 nb = vertex_normal(world, rows, at.vertices.y);
    const float3 nc = vertex_normal(world, rows, at.vertices.z);
    const float3 n = at.weights.x * na + at.weights.y * nb + at.weights.z * nc;
    at.normal = safe_normalize(n, at.flat_normal);
    const float side = dot(n, at.flat_normal) < 0.0f ? -1.0f : 1.0f;
    at.bulge = at.weights.x * above_plane(at.position - a, side * na)
        + at.weights.y * above_plane(at.position - b, side * nb)
        + at.weights.z * above_plane(at.position - c, side * nc);
    return at;
}

// Return the scattering point of a hit. Where the interpolated normals imply a bulge, rays start on it (J.
// Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021), so that a tessellated ball does not
// shade itself. Other rays that the normal sends below the triangle meet it again from outside, so that
// none gets into a solid.
static inline ALWAYS_INLINE Scatterer object_point(
    const Objects world, const ObjectHit hit, float3 o, float3 d)
{
    const ObjectSurface at = object_surface(world, hit, d);
    Scatterer point;
    point.position = at.position + at.bulge + OBJECT_ULPS * at.reach * at.flat_normal;
    // On the visible side; near silhouettes it may still face away.
    const float3 n = dot(at.normal, at.flat_normal) < 0.0f ? -at.normal : at.normal;
    point.normal = n - 2.0f * fmax(dot(n, d), 0.0f) * d;
    point.albedo = object_albedo(world, at.material, at.vertices, at.weights);
    point.material = at.material;
    return point;
}

static inline float object_lift(const Objects world, float distance)
{
    return OBJECT_DEPTH_ERROR * distance;
}

#endif
