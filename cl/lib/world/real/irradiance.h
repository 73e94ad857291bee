// Irradiance cache: E_R / pi at the cells of a coarse equirect grid.
//
// A cell holds two surfaces. The first `columns * rows` entries are the panorama's surfaces at the cells'
// centres. As many more follow for thin surfaces that no centre nearby shows, such as the side of a book.
#pragma once

#include "maths/equirect.h"
#include "maths/maths.h"
#include <iprt.world.real.irradiance>

// A cell counts for points within this distance of its tangent plane, as a fraction of theirs ...
#define CACHE_PLANE 0.02f
// ... and with a similar normal: least cosine.
#define CACHE_NORMAL 0.8f

// Cosines of normals that share one irradiance, and of normals for which the flux counts fully.
#define CACHE_LIKE 0.997f
#define CACHE_UNLIKE 0.98f
// Largest factor of irradiance from a cell's normal to a point's.
#define CACHE_TURNED 4.0f

#define CACHE_SURFACES 2

// Return the upper left of the four cells around direction p, and the offset of p from its centre.
static inline int2 cache_corner(int columns, int rows, float3 p, float2 *past)
{
    const float2 uv = equirect_uv(p);
    const float x = uv.x * columns - 0.5f, y = uv.y * rows - 0.5f;
    const int2 corner = (int2)((int)floor(x), (int)floor(y));
    *past = (float2)(x - corner.x, y - corner.y);
    return corner;
}

static inline int cache_cell(int columns, int rows, int x, int y)
{
    x = x < 0 ? x + columns : x >= columns ? x - columns : x;
    return min(max(y, 0), rows - 1) * columns + x;
}

// Return how far a cell's surface is the point's: 1 on its plane, 0 on another surface.
static inline float cache_agreement(float4 plane, float3 p, float3 n)
{
    const float inverse = rsqrt(fmax(dot(plane.xyz, plane.xyz), 1e-30f));
    const float facing = -dot(plane.xyz, n) * inverse;
    const float apart = fabs(dot(plane.xyz, p) - 1.0f) * inverse;
    const float near = 1.0f - apart / (CACHE_PLANE * length(p));
    return plane.w > 0.0f && facing > CACHE_NORMAL ? fmax(near, 0.0f) : 0.0f;
}

// E_R / pi by the cells around a point: the weighted sum over the cells that show the point's surface, and
// the brightest value of any.
typedef struct {
    float r, g, b;
    float weights;
    float brightest_r, brightest_g, brightest_b;
} CellLight;

// Return the light of the four cells around the point p with normal n: of the first surfaces of the cells,
// or of the second ones. For lane loops: of scalars, without branches.
//
// From a cell's normal m to n, E / pi changes by the part of the flux perpendicular to m (rotational gradient;
// G. J. Ward, P. S. Heckbert, "Irradiance Gradients", Eurographics Workshop on Rendering 1992). Normals of
// neighbouring cells of one surface differ by up to CACHE_LIKE, where the flux would add only noise.
static inline ALWAYS_INLINE CellLight light_around(
    const IrradianceCache cache, int second, float px, float py, float pz, float nx, float ny, float nz)
{
    const int cells = cache.columns * cache.rows, first = second ? cells : 0;
    const float2 uv = equirect_uv((float3)(px, py, pz));
    const float x = uv.x * cache.columns - 0.5f, y = uv.y * cache.rows - 0.5f;
    const int left = (int)floor(x), top = (int)floor(y);
    const float past_x = x - left, past_y = y - top;
    const float reach = CACHE_PLANE * sqrt(px * px + py * py + pz * pz);
    __global const float *restrict planes = (__global const float *)cache.plane;
    __global const float *restrict values = (__global const float *)cache.irradiance;
    __global const float *restrict fluxes = values + 4 * CACHE_SURFACES * cells;
    CellLight sum = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
    float change = 0.0f;
    #pragma unroll
    for (int i = 0; i < 4; i++) {
        const int at = 4 * (first + cache_cell(cache.columns, cache.rows, left + (i & 1), top + (i >> 1)));
        const float a = planes[at], b = planes[at + 1], c = planes[at + 2];
        const float inverse = 1.0f / sqrt(fmax(a * a + b * b + c * c, 1e-30f));
        const float facing = -(a * nx + b * ny + c * nz) * inverse;
        const float apart = fabs(a * px + b * py + c * pz - 1.0f) * inverse;
        const float near = fmax(1.0f - apart / reach, 0.0f);
        const int same = (planes[at + 3] > 0.0f) & (facing > CACHE_NORMAL);
        const float agrees = same ? near : 0.0f;
        const float r = values[at], g = values[at + 1], of_b = values[at + 2];
        const int is_known = values[at + 3] > 0.0f;
        const float bilinear = (i & 1 ? past_x : 1.0f - past_x) * (i & 2 ? past_y : 1.0f - past_y);
        const float weight = is_known ? (bilinear + 1e-3f) * agrees : 0.0f;
        const float fx = fluxes[at], fy = fluxes[at + 1], fz = fluxes[at + 2];
        const float along = -(fx * a + fy * b + fz * c) * inverse;
        const float unlike = (CACHE_LIKE - facing) / (CACHE_LIKE - CACHE_UNLIKE);
        const float share = fmin(fmax(unlike, 0.0f), 1.0f);
        change += weight * share * (fx * nx + fy * ny + fz * nz - facing * along);
        sum.r += weight * r;
        sum.g += weight * g;
        sum.b += weight * of_b;
        sum.weights += weight;
        sum.brightest_r = fmax(sum.brightest_r, is_known ? r : 0.0f);
        sum.brightest_g = fmax(sum.brightest_g, is_known ? g : 0.0f);
        sum.brightest_b = fmax(sum.brightest_b, is_known ? of_b : 0.0f);
    }
    // A leg or a fold thinner than a cell has one entry for all of its normals.
    const float bright = fmax(luminance((float3)(sum.r, sum.g, sum.b)), 1e-30f);
    const float factor = fmin(fmax(1.0f + change / bright, 1.0f / CACHE_TURNED), CACHE_TURNED);
    sum.r *= factor;
    sum.g *= factor;
    sum.b *= factor;
    return sum;
}

// Return E_R / pi at the point p with normal n; 0 where no cell around it is known.
static inline float3 cached_irradiance(const IrradianceCache cache, float3 p, float3 n)
{
    const CellLight first = light_around(cache, 0, p.x, p.y, p.z, n.x, n.y, n.z);
    if (first.weights > 0.0f)
        return (float3)(first.r, first.g, first.b) / first.weights;
    const CellLight second = light_around(cache, 1, p.x, p.y, p.z, n.x, n.y, n.z);
    if (second.weights > 0.0f)
        return (float3)(second.r, second.g, second.b) / second.weights;
    // Surfaces in no cell take the brightest value around them: they may face brighter light, and an
    // irradiance that is too small would turn faint shadows into black specks.
    return fmax((float3)(first.brightest_r, first.brightest_g, first.brightest_b),
                (float3)(second.brightest_r, second.brightest_g, second.brightest_b));
}

// Return 1 / (E_R / pi), per color; 0 where it is black.
static inline float3 inverse_of_irradiance(float3 irradiance, float black)
{
    return (float3)(irradiance.x > black ? 1.0f / irradiance.x : 0.0f,
                    irradiance.y > black ? 1.0f / irradiance.y : 0.0f,
                    irradiance.z > black ? 1.0f / irradiance.z : 0.0f);
}

// Return it at the point p with normal n.
static inline float3 inverse_irradiance(const IrradianceCache cache, float3 p, float3 n)
{
    return inverse_of_irradiance(cached_irradiance(cache, p, n), cache.black);
}
