// The virtual objects as rays see them: triangles in a bounding volume hierarchy.
#pragma once

#include "world/objects/bvh.h"
#include "maths/kernel_attributes.h"
#include "maths/grid.h"
#include "maths/maths.h"
#include "maths/rng.h"
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

// Least cosine between the normal of a map and the triangle's.
#define MIN_RISE 0.01f

typedef BvhHit ObjectHit;

// Bits of an image's first texel: its place, and from TEXTURE_WRAP on how it is read beyond 0 and 1 along u and v, two
// bits each. Bit of its width: the nearest texel is read.
#define TEXTURE_WRAP 28
#define TEXTURE_NEAREST 30
#define WRAP_CLAMP 1
#define WRAP_MIRROR 2

// Return a coordinate of a texture of `size` texels in the range of their centres.
static inline float wrapped(float u, uint wrap, float size)
{
    const float half_texel = 0.5f / size, turned = u - 2.0f * floor(0.5f * u);
    u = wrap == WRAP_MIRROR ? 1.0f - fabs(1.0f - turned) : u;
    return clamp(u, half_texel, 1.0f - half_texel);
}

// Return the bilinear value of a texture; row 0 is at v = 1.
static inline float4 object_texture(__global const half *texels, int4 image, float2 uv)
{
    const uint wrap = (uint)image.x >> TEXTURE_WRAP;
    const int nearest = image.y >> TEXTURE_NEAREST;
    image.xy &= (int2)((1 << TEXTURE_WRAP) - 1, (1 << TEXTURE_NEAREST) - 1);
    if (wrap & 3u)
        uv.x = wrapped(uv.x, wrap & 3u, image.y);
    if (wrap >> 2)
        uv.y = wrapped(uv.y, wrap >> 2, image.z);
    if (nearest)
        uv = (floor(uv * (float2)(image.y, image.z)) + 0.5f) / (float2)(image.y, image.z);
    const float2 at = (uv - floor(uv)) * (float2)(image.y, -image.z) - 0.5f;
    const float2 low = floor(at), part = at - low;
    int x = (int)low.x, y = (int)low.y + image.z;
    x = clamp(x < 0 ? x + image.y : x, 0, image.y - 1);
    y = clamp(y < 0 ? y + image.z : y, 0, image.z - 1);
    const int right = x + 1 < image.y ? x + 1 : 0, below = y + 1 < image.z ? y + 1 : 0;
    const int row0 = image.x + y * image.y, row1 = image.x + below * image.y;
    const float4 upper = mix(vload_half4(row0 + x, texels), vload_half4(row0 + right, texels), part.x);
    const float4 lower = mix(vload_half4(row1 + x, texels), vload_half4(row1 + right, texels), part.x);
    return mix(upper, lower, part.y);
}

// Rows per material of the table of albedos and textures (iprt/world/objects/object_bvh.py).
#if defined(EMISSION)
#define TEXTURED_ROWS 8
#elif defined(NORMAL_MAPS)
#define TEXTURED_ROWS 6
#elif defined(PRINCIPLED)
#define TEXTURED_ROWS 4
#else
#define TEXTURED_ROWS 2
#endif

static inline float2 object_uv(const Objects world, int4 vertices, float3 weights)
{
    return weights.x * world.bvh.uvs[vertices.x] + weights.y * world.bvh.uvs[vertices.y]
        + weights.z * world.bvh.uvs[vertices.z];
}

// Return a material's albedo at barycentric weights of a triangle; `material` counts all instances'.
static inline float3 object_albedo(const Objects world, int material, int4 vertices, float3 weights)
{
    float3 albedo = world.bvh.albedos[TEXTURED_ROWS * material].xyz;
    const int4 image = as_int4(world.bvh.albedos[TEXTURED_ROWS * material + 1]);
    if (image.y > 0)
        albedo *= object_texture(world.bvh.texels, image, object_uv(world, vertices, weights)).xyz;
    return albedo;
}

// Return metalness and alpha of a principled material there.
static inline float2 object_finish(const Objects world, int material, int4 vertices, float3 weights)
{
    float2 finish = (float2)(0.0f);
#ifdef PRINCIPLED
    finish = world.bvh.albedos[TEXTURED_ROWS * material + 2].xy;
    const int4 image = as_int4(world.bvh.albedos[TEXTURED_ROWS * material + 3]);
    if (image.y > 0) {
        // Textures scale the square root of alpha.
        const float2 scale = object_texture(world.bvh.texels, image, object_uv(world, vertices, weights)).xy;
        finish *= (float2)(scale.x, scale.y * scale.y);
    }
#endif
    return finish;
}

#ifdef EMISSION
// Return the radiance that a material emits there.
static inline float3 object_emission(const Objects world, int material, int4 vertices, float3 weights)
{
    float3 emission = world.bvh.albedos[TEXTURED_ROWS * material + 6].xyz;
    const int4 image = as_int4(world.bvh.albedos[TEXTURED_ROWS * material + 7]);
    if (image.y > 0)
        emission *= object_texture(world.bvh.texels, image, object_uv(world, vertices, weights)).xyz;
    return emission;
}
#endif

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

#ifdef HOLES
// Most surfaces that a ray passes through.
#define MOST_HOLES 64

// Return whether a ray from o along d meets the surface of a hit, rather than passing through it. Where a share of the
// rays passes, it is chosen by a hash of the ray.
static inline int is_met(const Objects world, const ObjectHit hit, float3 o, float3 d)
{
    const int material = object_material(world, hit);
    __global const float4 *rows = world.bvh.albedos + TEXTURED_ROWS * material;
    const int4 image = as_int4(rows[1]);
    float opacity = rows[0].w;
    if (image.y > 0) {
        const float3 weights = (float3)(1.0f - hit.u - hit.v, hit.u, hit.v);
        const float2 uv = object_uv(world, world.bvh.triangles[hit.triangle], weights);
        opacity *= object_texture(world.bvh.texels, image, uv).w;
    }
    const float cutoff = rows[1].w;
    if (cutoff > 0.0f)
        return opacity >= cutoff;
    if (opacity >= 1.0f)
        return 1;
    const uint ray = hash_combine(hash_combine(as_uint(d.x), as_uint(d.y)), as_uint(d.z));
    const uint from = hash_combine(hash_combine(as_uint(o.x), as_uint(o.y)), as_uint(o.z));
    return u01(hash_combine(hash_combine(ray, from), (uint)hit.triangle)) < opacity;
}

static inline ALWAYS_INLINE int trace_objects(
    const Objects world, float3 o, float3 d, float t_max, int any, ObjectHit *hit)
{
    if (!is_ray(o, d))
        return 0;
    float start = 0.0f;
    for (int i = 0; i < MOST_HOLES; i++) {
        // Any hit may be a hole: the nearest one is needed to go on from.
        if (!bvh_trace(world.bvh, o + start * d, d, t_max - start, 0, hit))
            return 0;
        hit->t += start;
        if (is_met(world, *hit, o, d))
            return 1;
        start = hit->t + OBJECT_ULPS * (largest(o) + hit->t);
    }
    return 0;
}
#else
static inline ALWAYS_INLINE int trace_objects(
    const Objects world, float3 o, float3 d, float t_max, int any, ObjectHit *hit)
{
    return is_ray(o, d) && bvh_trace(world.bvh, o, d, t_max, any, hit);
}
#endif

// The triangle that a ray along d has hit, in world space.
typedef struct {
    float3 position;
    float3 flat_normal;   // of the plane, towards the viewer
    float3 normal;        // of the map, or interpolated, outward in the mesh; flat_normal without normals
    float3 bulge;         // from position to the curved surface implied by the normals, if outside
    float reach;          // the largest coordinate in its computation
    int4 vertices;        // w: the material of the mesh
    float3 weights;
    int material;         // index among all instances' materials
} ObjectSurface;

#ifdef NORMAL_MAPS
// Return the normal that a map gives at a surface, on the same side as its interpolated one.
static inline float3 mapped_normal(
    const Objects world, __global const float4 *rows, int material, int4 vertices, float3 weights, float3 n)
{
    const int4 image = as_int4(world.bvh.albedos[TEXTURED_ROWS * material + 5]);
    if (image.y == 0)
        return n;
    const float4 tangent = weights.x * world.bvh.tangents[vertices.x]
        + weights.y * world.bvh.tangents[vertices.y] + weights.z * world.bvh.tangents[vertices.z];
    const float3 own = weights.x * world.bvh.normals[vertices.x].xyz
        + weights.y * world.bvh.normals[vertices.y].xyz + weights.z * world.bvh.normals[vertices.z].xyz;
    const float3 bitangent = copysign(1.0f, tangent.w) * cross(own, tangent.xyz);
    const float3 x = safe_normalize(bvh_transform(rows + 3, tangent.xyz, 0.0f), (float3)(0.0f));
    const float3 y = safe_normalize(bvh_transform(rows + 3, bitangent, 0.0f), (float3)(0.0f));
    const float3 at = object_texture(world.bvh.texels, image, object_uv(world, vertices, weights)).xyz;
    return safe_normalize(at.x * x + at.y * y + fmax(at.z, 0.0f) * n, n);
}
#endif

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
#ifdef NORMAL_MAPS
    at.normal = mapped_normal(world, rows, at.material, at.vertices, at.weights, at.normal);
    // It does not turn to the other side of the triangle.
    const float3 up = side * at.flat_normal;
    at.normal = safe_normalize(at.normal + fmax(MIN_RISE - dot(at.normal, up), 0.0f) * up, up);
#endif
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
    point.finish = object_finish(world, at.material, at.vertices, at.weights);
    point.material = at.material;
#ifdef EMISSION
    point.emission = object_emission(world, at.material, at.vertices, at.weights);
    point.facing = fabs(dot(at.flat_normal, d));
#endif
#ifdef REFRACTS
    point.beyond = at.position - OBJECT_ULPS * at.reach * at.flat_normal;
    point.plane = at.flat_normal;
    point.enters = dot(at.normal, at.flat_normal) >= 0.0f;
#endif
    return point;
}

static inline float object_lift(const Objects world, float distance)
{
    return OBJECT_DEPTH_ERROR * distance;
}

#endif
