// Light sampling of the panorama: directions towards its bright texels, from any point.
//
// A table of equirect cells holds densities about the capture centre, proportional to the excess of each
// cell's luminance over the mean; the rest is left to BRDF sampling. A sample is a point y on the real
// surface. Its density per area is p0 cos_0 / |y|^2, where p0 is the table's. Its density per solid angle
// at x is this times |y - x|^2 / cos_y, so that parallax is correct. Visibility of y from x is left to the
// march of the ray.
//
// -D IMPOSTOR aims at the table's directions as they are: the density is known whatever a ray meets.
#pragma once

#include "maths/maths.h"
#include "world/real/real.h"
#include "world/real/sun.h"
#include <iprt.world.real.lights>

#if defined(DISTANT_ENVIRONMENT) || defined(IMPOSTOR)
#define LIGHTS_FAR_AWAY // aimed at in the table's directions
#endif

// Surfaces that the capture centre sees at a smaller cosine are not aimed at.
#define LIGHT_GRAZING 0.05f
// Rays that hit a surface this far off the texel's plane, as a fraction of its distance from the centre,
// hit the join of two planes, which is never aimed at.
#define LIGHT_OFF_PLANE 1e-3f

// Return whether any cell is brighter than the mean. An even panorama is not aimed at.
static inline int lights_shine(const Lights lights)
{
    return lights.column && lights.column[lights.columns] > 0.0f;
}

// Find the column of cells in which a share u of the light ends; returns how far into it, in [0, 1].
static inline float find_light_column(const Lights lights, float u, int *column)
{
    int low = 0, high = lights.columns;   // column[low] <= u < column[high]
    while (high - low > 1) {
        const int middle = (low + high) >> 1;
        if (lights.column[middle] <= u)
            low = middle;
        else
            high = middle;
    }
    *column = low;
    const float start = lights.column[low];
    return clamp((u - start) / (lights.column[low + 1] - start), 0.0f, 1.0f);
}

// Find the row in which a share u of the light of a column ends; returns how far into it, in [0, 1].
static inline float find_light_row(const Lights lights, int column, float u, int *row)
{
    int low = -1, high = lights.rows - 1;   // share[low] <= u < share[high]
    while (high - low > 1) {
        const int middle = (low + high) >> 1;
        if (lights.share[middle * lights.columns + column] <= u)
            low = middle;
        else
            high = middle;
    }
    *row = high;
    const float start = low < 0 ? 0.0f : lights.share[low * lights.columns + column];
    return clamp((u - start) / (lights.share[high * lights.columns + column] - start), 0.0f, 1.0f);
}

// Return y of the upper edge of a row of cells, on the unit sphere.
static inline float light_edge(const Lights lights, int row)
{
    return unit_circle(0.5f * row / lights.size.y).x;
}

// Sample a unit direction from the capture centre with the table's density; u in [0, 1)^2.
static inline float3 sample_light(const Lights lights, float2 u)
{
    int column, row;
    const float across = find_light_column(lights, u.x, &column);
    const float down = find_light_row(lights, column, u.y, &row);
    const float y = mix(light_edge(lights, row), light_edge(lights, row + 1), down);
    const float s = sqrt(fmax(1.0f - y * y, 0.0f));
    const float2 azimuth = unit_circle((column + across) / lights.size.x);   // from -Z, by half a turn
    return (float3)(-s * azimuth.y, y, s * azimuth.x);
}

// Return whether rays in this direction aim at the background, rather than at its occluder.
static inline int aims_behind(const RealLayer layer, int texel)
{
    return layer.background.surface && ((int)layer.background.surface[texel].w & SURFACE_AIMED) != 0;
}

// Return the direction from x to the point of the tangent plane of `texel` in direction v.
static inline float3 towards_light(const RealLayer layer, float3 v, int texel, float3 x)
{
#ifdef LIGHTS_FAR_AWAY
    return v;
#else
    float4 surface = layer.surface[texel];
    float farthest = layer.grid.range[texel].y;
    if (aims_behind(layer, texel)) {
        surface = layer.background.surface[texel];
        farthest = layer.background.range[texel].y;
    }
    if ((int)surface.w & SURFACE_NONE)
        return v;
    const float inverse = dot(surface.xyz, v);
    const float radius = inverse > 0.0f ? 1.0f / inverse : farthest;
    return safe_normalize(radius * v - x, v);
#endif
}

// Return an upper limit of the distance from x to the light of `texel` in direction d, from towards_light().
static inline ALWAYS_INLINE float light_distance(const RealLayer layer, int texel, float3 x, float3 d)
{
#ifdef LIGHTS_FAR_AWAY
    return INFINITY;
#else
#ifdef SUN
    if (texel >= SHADE_TEXEL)
        return INFINITY;
#endif
    const float4 surface = aims_behind(layer, texel) ? layer.background.surface[texel] : layer.surface[texel];
    const float t = (1.0f - dot(surface.xyz, x)) / dot(surface.xyz, d);
    return !((int)surface.w & SURFACE_NONE) && t > 0.0f ? t + layer.bias : INFINITY;
#endif
}

static inline int light_cell(const Lights lights, float3 v)
{
    const float2 uv = equirect_uv(v);
    return sized_texel(uv, lights.columns, lights.rows, lights.size);
}

// Return the density per solid angle with which light sampling samples d at the start of a ray along d, given
// its hit.
static inline float light_density(const Lights lights, const RealLayer layer, const RealHit hit, float3 d)
{
#ifdef IMPOSTOR
    return lights.density ? lights.density[light_cell(lights, d)] : 0.0f;
#else
    if (!lights.density || (hit.kind != HIT_SURFACE && hit.kind != HIT_SKY))
        return 0.0f;
    if (hit.behind != aims_behind(layer, hit.texel))
        return 0.0f;
    const float density = lights.density[light_cell(lights, hit.direction)];
    if (!(density > 0.0f) || hit.kind == HIT_SKY)
        return density;
    const float3 g = (hit.behind ? layer.background.surface : layer.surface)[hit.texel].xyz;
    const float3 y = hit_point(hit);
    const float towards_centre = dot(g, hit.direction);
    if (!(towards_centre > LIGHT_GRAZING * length(g) && fabs(dot(g, y) - 1.0f) < LIGHT_OFF_PLANE))
        return 0.0f;
    return density * towards_centre * hit.t * hit.t
        / (dot(y, y) * fmax(fabs(dot(g, d)), 1e-6f * towards_centre));
#endif
}
