// Construction of the distance impostor (lib/world/real/impostor.h) from the panorama.
//
//   kernel           in                                 out
//   splat_surfaces   panorama (lib/world/real/real.h)   nearest: 1 + bits of the largest inverse
//                                                       distance, 0: a hole; source: 1 + its texel in
//                                                       the panorama
//   shade_impostor   nearest, source, panorama          texels: rgb, inverse distance; -1: a hole
//   show_impostor    impostor                           picture: equirect, 3 a texel
#include "world/real/impostor.h"
#include "world/real/real.h"

// Tolerance of the test for points inside a texel's outline on a face, in texels.
#define OUTLINE 0.01f
// Least cosine between a direction and the axis of a face that shows it. Corners of a face have 0.577.
#define FACE_COSINE 0.5f
// Rounding differences, in units in the last place, between the two launches of splat_surfaces.
#define CLAIM_ULPS 16u
// Most lookups in the panorama along a side of an impostor texel.
#define MOST_LOOKS 4

// Return the direction from the capture centre of the panorama's column and row edges.
static inline float3 corner_direction(float u, float v)
{
    const float2 azimuth = unit_circle(u), polar = unit_circle(0.5f * v);
    return (float3)(-polar.y * azimuth.y, polar.x, polar.y * azimuth.x);
}

// Return the corner of a texel's surface relative to the impostor's centre; in open sky, its direction.
static inline float3 surface_corner(float4 surface, float2 range, float3 v, float3 centre)
{
    if ((int)surface.w & SURFACE_NONE)
        return v;
    const float inverse = dot(surface.xyz, v);
    return (inverse > 0.0f ? clamp(1.0f / inverse, range.x, range.y) : range.y) * v - centre;
}

// Return the inverse distance, 1/m, of the tangent plane along the unit vector w; 0: open sky.
static inline float plane_inverse(float4 surface, float3 w, float3 centre)
{
    return (int)surface.w & SURFACE_NONE
        ? 0.0f : dot(surface.xyz, w) / (1.0f - dot(surface.xyz, centre));
}

static inline float turn(float2 a, float2 b) { return a.x * b.y - a.y * b.x; }

// Return how far p lies inside the edge from a to b; `sense` is the orientation of the outline.
static inline float inside_edge(float2 a, float2 b, float2 p, float sense)
{
    return sense * turn(b - a, p - a) + OUTLINE * length(b - a);
}

__kernel void splat_surfaces(
    const int width,
    const int height,
    __global const float4 *restrict real_surface,
    __global const float2 *restrict real_range,
    const float4 centre,                    // of the impostor, metres
    const int side,
    const int claims,                       // 0: fill `nearest`; 1, launched next: fill `source`
    __global uint *restrict nearest,        // in, out
    __global uint *restrict source)         // in, out
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int texel = y * width + x;
    const float4 surface = real_surface[texel];
    const float2 range = real_range[texel];
    const float left = (float)x / width, right = (float)(x + 1) / width;
    const float top = (float)y / height, bottom = (float)(y + 1) / height;
    const float3 a = surface_corner(surface, range, corner_direction(left, top), centre.xyz);
    const float3 b = surface_corner(surface, range, corner_direction(right, top), centre.xyz);
    const float3 c = surface_corner(surface, range, corner_direction(right, bottom), centre.xyz);
    const float3 d = surface_corner(surface, range, corner_direction(left, bottom), centre.xyz);
    const float3 middle = a + b + c + d;
    const float near = fmin(fmin(length(a), length(b)), fmin(length(c), length(d)));
    const float far = fmax(fmax(length(a), length(b)), fmax(length(c), length(d)));
    if (!(near > 0.0f && is_finite(far)))
        return;
    for (int face = 0; face < CUBE_FACES; face++) {
        const int axis = face >> 1;
        const float sign = face_sign(face);
        const float ahead = sign * to_face(axis, middle).x;
        const float fa = sign * to_face(axis, a).x, fb = sign * to_face(axis, b).x;
        const float fc = sign * to_face(axis, c).x, fd = sign * to_face(axis, d).x;
        if (!(ahead > FACE_COSINE * length(middle)
              && fmin(fmin(fa, fb), fmin(fc, fd)) > 0.1f * near))
            continue;
        const float2 pa = cube_place(face, a, side), pb = cube_place(face, b, side);
        const float2 pc = cube_place(face, c, side), pd = cube_place(face, d, side);
        const float2 low = fmax(fmin(fmin(pa, pb), fmin(pc, pd)) - OUTLINE, 0.0f);
        const float2 high = fmin(fmax(fmax(pa, pb), fmax(pc, pd)) + OUTLINE, side - 1.0f);
        const float sense = turn(pc - pa, pd - pb) < 0.0f ? -1.0f : 1.0f;
        for (int row = (int)ceil(low.y); row <= (int)floor(high.y); row++)
            for (int column = (int)ceil(low.x); column <= (int)floor(high.x); column++) {
                const float2 p = (float2)(column, row);
                if (fmin(fmin(inside_edge(pa, pb, p, sense), inside_edge(pb, pc, p, sense)),
                         fmin(inside_edge(pc, pd, p, sense), inside_edge(pd, pa, p, sense))) < 0.0f)
                    continue;
                const float3 w = normalize(cube_direction(face, p, side));
                // The tangent plane extends beyond the texel, where it may be seen edge-on.
                const float inverse = (int)surface.w & SURFACE_NONE
                    ? 0.0f
                    : fmin(fmax(plane_inverse(surface, w, centre.xyz), 1.0f / far), 1.0f / near);
                const uint key = as_uint(inverse) + 1u;
                const int at = (face * side + row) * side + column;
                if (!claims)
                    atomic_max(nearest + at, key);
                else if (key + CLAIM_ULPS >= nearest[at])
                    atomic_max(source + at, (uint)texel + 1u);
            }
    }
}

__kernel void shade_impostor(
    const int width,
    const int height,
    __global const float4 *restrict real_surface,
    __global const float *restrict color,   // radiance, 3 a texel
    const float4 centre,
    const int side,
    __global const uint *restrict nearest,
    __global const uint *restrict source,
    __global float4 *restrict texels)       // out
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= side || y >= CUBE_FACES * side)
        return;
    const int at = y * side + x, face = y / side, row = y - face * side;
    if (nearest[at] == 0u || source[at] == 0u) {
        texels[at] = (float4)(0.0f, 0.0f, 0.0f, -1.0f);
        return;
    }
    const float4 surface = real_surface[source[at] - 1u];
    const float inverse = as_float(nearest[at] - 1u);
    const float3 v = cube_direction(face, (float2)(x, row), side);
    const int sky = !(inverse > 0.0f);
    // Number of panorama texels across an impostor texel: a mean over several preserves small lights.
    const float3 p = normalize(v) / fmax(inverse, 1e-30f);
    const float nearer = sky ? 1.0f : length(p) / fmax(length(p + centre.xyz), 1e-30f);
    const float across = 2.0f / side / dot(v, v) * nearer * height / IPRT_PI;
    const int looks = clamp((int)ceil(across), 1, MOST_LOOKS);
    float3 sum = (float3)(0.0f);
    for (int i = 0; i < looks * looks; i++) {
        const float2 within = ((float2)(i % looks, i / looks) + 0.5f) / looks - 0.5f;
        const float3 w = normalize(cube_direction(face, (float2)(x, row) + within, side));
        const float there =
            fmin(fmax(plane_inverse(surface, w, centre.xyz), 0.5f * inverse), 2.0f * inverse);
        const float3 seen = sky ? w : w / there + centre.xyz;
        sum += panorama_bilinear(color, width, height, equirect_uv(seen));
    }
    texels[at] = (float4)(sum / (looks * looks), inverse);
}

__kernel void show_impostor(
    const Impostor impostor,
    const int rows,
    __global float *restrict picture)       // out: 2 rows x rows
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= 2 * rows || y >= rows)
        return;
    float3 sum = (float3)(0.0f);
    for (int i = 0; i < 4; i++) {
        const float u = (x + 0.25f + 0.5f * (i & 1)) / (2 * rows);
        const float v = (y + 0.25f + 0.5f * (i >> 1)) / rows;
        sum += impostor_radiance(impostor, equirect_direction(u, v));
    }
    vstore3(0.25f * sum, y * 2 * rows + x, picture);
}
