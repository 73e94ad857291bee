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
    return clamp(y, 0, rows - 1) * columns + x;
}

static inline float3 cache_normal(float4 plane)
{
    return -plane.xyz * rsqrt(fmax(dot(plane.xyz, plane.xyz), 1e-30f));
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

// Return the change of E / pi from normal m, a cell's, to normal n. The first derivative of irradiance is
// the part of the flux perpendicular to m (rotational gradient; G. J. Ward, P. S. Heckbert, "Irradiance
// Gradients", Eurographics Workshop on Rendering 1992). Normals of neighbouring cells of one surface differ
// by up to CACHE_LIKE, where the flux would add only noise.
static inline float turned(float3 flux, float3 m, float3 n)
{
    const float facing = dot(n, m);
    const float share = clamp((CACHE_LIKE - facing) / (CACHE_LIKE - CACHE_UNLIKE), 0.0f, 1.0f);
    return share * (dot(flux, n) - facing * dot(flux, m));
}

// Return E_R / pi at the point p with normal n; 0 where no cell around it is known.
static inline float3 cached_irradiance(const IrradianceCache cache, float3 p, float3 n)
{
    float2 past;
    const int2 corner = cache_corner(cache.columns, cache.rows, p, &past);
    const int entries = CACHE_SURFACES * cache.columns * cache.rows;
    float3 sum = (float3)(0.0f), brightest = (float3)(0.0f);
    float weights = 0.0f, change = 0.0f;
    for (int k = 0; k < 4 * CACHE_SURFACES; k++) {
        const int i = k & 3;
        if (i == 0 && weights > 0.0f)
            break;
        const int cell = cache_cell(cache.columns, cache.rows, corner.x + (i & 1), corner.y + (i >> 1))
            + (k >> 2) * cache.columns * cache.rows;
        const float4 value = cache.irradiance[cell], plane = cache.plane[cell];
        const float bilinear = (i & 1 ? past.x : 1.0f - past.x) * (i & 2 ? past.y : 1.0f - past.y);
        const float known = value.w > 0.0f ? bilinear + 1e-3f : 0.0f;
        const float weight = known * cache_agreement(plane, p, n);
        sum += weight * value.xyz;
        change += weight * turned(cache.irradiance[entries + cell].xyz, cache_normal(plane), n);
        weights += weight;
        brightest = fmax(brightest, known > 0.0f ? value.xyz : (float3)(0.0f));
    }
    // A leg or a fold thinner than a cell has one entry for all of its normals.
    const float factor = clamp(1.0f + change / fmax(luminance(sum), 1e-30f), 1.0f / CACHE_TURNED, CACHE_TURNED);
    // Surfaces in no cell take the brightest value around them: they may face brighter light, and an
    // irradiance that is too small would turn faint shadows into black specks.
    return weights > 0.0f ? factor / weights * sum : brightest;
}

// Return 1 / (E_R / pi) at a point, per color; 0 where it is black.
static inline float3 inverse_irradiance(const IrradianceCache cache, float3 p, float3 n)
{
    const float3 irradiance = cached_irradiance(cache, p, n);
    const float black = cache.black;
    return (float3)(irradiance.x > black ? 1.0f / irradiance.x : 0.0f,
                    irradiance.y > black ? 1.0f / irradiance.y : 0.0f,
                    irradiance.z > black ? 1.0f / irradiance.z : 0.0f);
}
