// The virtual objects as rays see them: triangles in a bounding volume hierarchy.
#pragma once

#include "world/objects/bvh.h"
#include "maths/kernel_attributes.h"
#include "maths/grid.h"
#include "maths/maths.h"
#include "maths/rng.h"
#include "world/objects/ray_cone.h"
#include "world/objects/scatterer.h"
#include "world/objects/textures.h"

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

// Rows of images of normals.
#define NORMAL_MAP_ROW 5
#define COAT_MAP_ROW 4

// The triangle that a ray along d has hit, in world space.
typedef struct {
    float3 position;
    float3 flat_normal;   // of the plane, towards the viewer
    float3 normal;        // of the map, or interpolated, outward in the mesh; flat_normal without normals
#ifdef COAT_NORMALS
    float3 coat_normal;   // of the clearcoat: the same of its own map
#endif
    float3 bulge;         // from position to the curved surface implied by the normals, if outside
    float reach;          // the largest coordinate in its computation
    int4 vertices;        // w: the material of the mesh
    float3 weights;
    int material;         // index among all instances' materials, and their variants
#ifdef TEXTURES
    float footprint;      // width of the ray there, in texture coordinates
#endif
#ifdef TEXTURE_PLACES
    float footprint2;     // the same in coordinates of the second set
#endif
} ObjectSurface;

#ifdef TEXTURES
static inline ALWAYS_INLINE float2 object_uv(__global const float2 *uvs, int4 vertices, float3 weights)
{
    return weights.x * uvs[vertices.x] + weights.y * uvs[vertices.y] + weights.z * uvs[vertices.z];
}

// Return the width in texture coordinates of a ray along d that meets a triangle; `facing`: the cross product of two of
// its edges, as long as twice its area. The width is the long axis of the cone's ellipse on the triangle, times the
// square root of the ratio of the areas.
static inline ALWAYS_INLINE float uv_footprint(
    __global const float2 *uvs, int4 vertices, float3 facing, float3 d, float width)
{
    const float2 a = uvs[vertices.x];
    const float2 b = uvs[vertices.y] - a, c = uvs[vertices.z] - a;
    const float areas = fabs(b.x * c.y - b.y * c.x) * length(facing);
    return width * sqrt(areas) / fmax(fabs(dot(facing, d)), 1e-30f);
}

#ifdef TEXTURE_PLACES
// Return texture coordinates there of a map that lies elsewhere; `place`: 1 + its index. Set the ray's width in them.
static inline ALWAYS_INLINE float2 placed_uv(
    const Objects world, const ObjectSurface at, int place, float *footprint)
{
    __global const float4 *rows = world.bvh.places + 2 * (place - 1);
    const int second = rows[0].w > 0.0f;
    const float2 uv = object_uv(second ? world.bvh.uvs2 : world.bvh.uvs, at.vertices, at.weights);
    *footprint = rows[1].w * (second ? at.footprint2 : at.footprint);
    const float3 from = (float3)(uv, 1.0f);
    return (float2)(dot(rows[0].xyz, from), dot(rows[1].xyz, from));
}
#endif

// Return the value there of the texture whose image is in a row of the table; 1 without one.
static inline ALWAYS_INLINE float4 mapped_value(const Objects world, const ObjectSurface at, int row)
{
    const int4 image = as_int4(world.bvh.albedos[TEXTURED_ROWS * at.material + row]);
    if (!(image.y > 0))
        return (float4)(1.0f);
#ifdef TEXTURE_PLACES
    // The first image's fourth number is the cutoff.
    if (row > 1 && image.w > 0) {
        float footprint;
        const float2 uv = placed_uv(world, at, image.w, &footprint);
        return object_texture(world.bvh.texels, image, uv, footprint);
    }
#endif
    return object_texture(world.bvh.texels, image, object_uv(world.bvh.uvs, at.vertices, at.weights), at.footprint);
}
#endif

// Return a material's albedo at a surface.
static inline ALWAYS_INLINE float3 object_albedo(const Objects world, const ObjectSurface at)
{
    float3 albedo = world.bvh.albedos[TEXTURED_ROWS * at.material].xyz;
#ifdef TEXTURES
    albedo *= mapped_value(world, at, 1).xyz;
#endif
    return albedo;
}

// Return metalness and alpha of a principled material there.
static inline ALWAYS_INLINE float2 object_finish(const Objects world, const ObjectSurface at)
{
    float2 finish = (float2)(0.0f);
#ifdef PRINCIPLED
    finish = world.bvh.albedos[TEXTURED_ROWS * at.material + 2].xy;
#ifdef TEXTURES
    // Textures scale the square root of alpha.
    const float2 scale = mapped_value(world, at, 3).xy;
    finish *= (float2)(scale.x, scale.y * scale.y);
#endif
#endif
    return finish;
}

#ifdef EMISSION
// Return the radiance that a material emits there.
static inline ALWAYS_INLINE float3 object_emission(const Objects world, const ObjectSurface at)
{
    float3 emission = world.bvh.albedos[TEXTURED_ROWS * at.material + 6].xyz;
#ifdef TEXTURES
    emission *= mapped_value(world, at, 7).xyz;
#endif
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

// Return the index, among all instances' materials, of the one that a ray has hit, whatever its variant.
static inline ALWAYS_INLINE int object_material(const Objects world, const ObjectHit hit)
{
    __global const float4 *rows = world.bvh.instances + BVH_INSTANCE_ROWS * hit.instance;
    return as_int(rows[6].y) + world.bvh.triangles[hit.triangle].w;
}

#ifdef HOLES
// Most surfaces that a ray passes through.
#define MOST_HOLES 64

// Return whether a ray from o along d meets the surface of a hit, rather than passing through it. Where a share of the
// rays passes, it is chosen by a hash of the ray. Opacity is read at the finest level: its mean, compared with the
// cutoff, would not cover the same share of a pixel.
static inline int is_met(const Objects world, const ObjectHit hit, float3 o, float3 d)
{
    const int material = object_material(world, hit);
    __global const float4 *rows = world.bvh.albedos + TEXTURED_ROWS * material;
    float opacity = rows[0].w;
#ifdef TEXTURES
    const int4 image = as_int4(rows[1]);
    if (image.y > 0) {
        const float3 weights = (float3)(1.0f - hit.u - hit.v, hit.u, hit.v);
        const float2 uv = object_uv(world.bvh.uvs, world.bvh.triangles[hit.triangle], weights);
        opacity *= level_value(world.bvh.texels, finest_level(image), uv).w;
    }
#endif
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

#ifdef VARIANTS
// Return the index of the variant that a ray along d meets; without any, of the material itself.
static inline ALWAYS_INLINE int drawn_variant(
    const Objects world, const ObjectSurface at, const ObjectHit hit, float3 d)
{
    const int4 image = world.bvh.variants[at.material];
    if (image.w == 0)
        return at.material;
    const uint ray = hash_combine(hash_combine(as_uint(d.x), as_uint(d.y)), as_uint(d.z));
    const uint place = hash_combine(hash_combine(as_uint(hit.u), as_uint(hit.v)), (uint)hit.triangle);
    const uint seed = hash_combine(ray, place);
    const float2 u = (float2)(u01(seed), u01(hash_combine(seed, 1)));
    const float2 uv = object_uv(world.bvh.uvs, at.vertices, at.weights);
    return image.w + drawn_index(world.bvh.indices, image, uv, at.footprint, u);
}
#endif

#ifdef NORMAL_MAPS
// Return a normal that does not turn to the other side of a triangle, whose own is `up`.
static inline float3 risen(float3 n, float3 up)
{
    return safe_normalize(n + fmax(MIN_RISE - dot(n, up), 0.0f) * up, up);
}

// Return the normal that the map in a row of the table gives at a surface, on the same side as its interpolated one.
static inline ALWAYS_INLINE float3 mapped_normal(
    const Objects world, __global const float4 *rows, const ObjectSurface surface, int row)
{
    const float3 n = surface.normal, weights = surface.weights;
    const int4 vertices = surface.vertices;
    if (as_int4(world.bvh.albedos[TEXTURED_ROWS * surface.material + row]).y == 0)
        return n;
    // Summed before the texture is read: registers would hold the loaded normals meanwhile.
    const float3 own = weights.x * world.bvh.normals[vertices.x].xyz
        + weights.y * world.bvh.normals[vertices.y].xyz + weights.z * world.bvh.normals[vertices.z].xyz;
    const float3 at = mapped_value(world, surface, row).xyz;
    const float4 tangent = weights.x * world.bvh.tangents[vertices.x]
        + weights.y * world.bvh.tangents[vertices.y] + weights.z * world.bvh.tangents[vertices.z];
    const float3 bitangent = copysign(1.0f, tangent.w) * cross(own, tangent.xyz);
    const float3 x = safe_normalize(bvh_transform(rows + 3, tangent.xyz, 0.0f), (float3)(0.0f));
    const float3 y = safe_normalize(bvh_transform(rows + 3, bitangent, 0.0f), (float3)(0.0f));
    return safe_normalize(at.x * x + at.y * y + fmax(at.z, 0.0f) * n, n);
}
#endif

// Return the offset from x up to the plane through the origin with normal n, 0 if x is above it.
static inline float3 above_plane(float3 x, float3 n) { return fmax(-dot(x, n), 0.0f) * n; }

// Return the surface of a hit of a ray along d.
static inline ALWAYS_INLINE ObjectSurface object_surface(
    const Objects world, const ObjectHit hit, float3 d, RayCone cone)
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
#ifdef TEXTURES
    at.footprint = uv_footprint(world.bvh.uvs, at.vertices, cross(b - a, c - a), d, cone_width(cone, hit.t));
#endif
#ifdef TEXTURE_PLACES
    at.footprint2 = uv_footprint(world.bvh.uvs2, at.vertices, cross(b - a, c - a), d, cone_width(cone, hit.t));
#endif
#ifdef VARIANTS
    at.material = drawn_variant(world, at, hit, d);
#endif
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
    const float3 up = side * at.flat_normal;
#ifdef COAT_NORMALS
    // The clearcoat's map, then the other. A loop, because the reading of a map is inlined.
    float3 mapped = at.normal;
    for (int i = 0; i < 2; i++) {
        at.coat_normal = mapped;
        mapped = risen(mapped_normal(world, rows, at, i == 0 ? COAT_MAP_ROW : NORMAL_MAP_ROW), up);
    }
    at.normal = mapped;
#else
    at.normal = risen(mapped_normal(world, rows, at, NORMAL_MAP_ROW), up);
#endif
#endif
    return at;
}

// Return a normal of a surface on the side that is seen.
static inline ALWAYS_INLINE float3 on_seen_side(const ObjectSurface at, float3 normal)
{
    return dot(at.normal, at.flat_normal) < 0.0f ? -normal : normal;
}

// Return a normal of a surface on the side that a ray along d comes from. Near silhouettes it may still face away: it is
// mirrored then.
static inline ALWAYS_INLINE float3 towards_viewer(const ObjectSurface at, float3 normal, float3 d)
{
    const float3 n = on_seen_side(at, normal);
    return n - 2.0f * fmax(dot(n, d), 0.0f) * d;
}

// Return the scattering point of a hit. Where the interpolated normals imply a bulge, rays start on it (J.
// Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021), so that a tessellated ball does not
// shade itself. Other rays that the normal sends below the triangle meet it again from outside, so that
// none gets into a solid.
static inline ALWAYS_INLINE Scatterer object_point(
    const Objects world, const ObjectHit hit, float3 o, float3 d, RayCone cone)
{
    const ObjectSurface at = object_surface(world, hit, d, cone);
    Scatterer point;
    point.position = at.position + at.bulge + OBJECT_ULPS * at.reach * at.flat_normal;
    point.normal = towards_viewer(at, at.normal, d);
    point.albedo = object_albedo(world, at);
#ifdef COAT_NORMALS
    const float3 coat = towards_viewer(at, at.coat_normal, d);
    point.finish = (Finish)(object_finish(world, at), packed_coat_normal(point.normal, coat));
#else
    point.finish = object_finish(world, at);
#endif
    point.material = at.material;
#ifdef EMISSION
    point.emission = object_emission(world, at);
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
