// Lights without geometry (iprt/geometry/light.py). -D VIRTUAL_LIGHTS with -D OBJECTS_BVH: there are some.
//
// No ray meets them, so that all their light comes from rays aimed at them. A light is chosen about in proportion to
// its irradiance without shadows. Spheres are sampled by the cone that they fill (Pharr, Jakob and Humphreys,
// "Physically Based Rendering", section 6.2.4), rectangles by their area, the sun by its disc.
#pragma once

#include "maths/equirect.h"
#include "maths/maths.h"
#include "maths/sampling.h"
#include "world/objects/objects.h"

#if defined(VIRTUAL_LIGHTS) && defined(OBJECTS_BVH)
#define SAMPLES_VIRTUAL_LIGHTS

// Layout of a light, LIGHT_ROWS float4:
//   row 0   position; radius of a sphere, or sine of half the sun's angular diameter
//   row 1   intensity on the axis, rgb; kind
//   row 2   axis: the unit direction in which it shines; first row of its profile, or -1
//   row 3   unit vector across; scale of a spot's falloff
//   row 4   unit vector across both; offset of the falloff
//   row 5   half width and half height of a rectangle; luminance of the intensity; 0
#define LIGHT_ROWS 6
#define LIGHT_SPHERE 0
#define LIGHT_RECTANGLE 1
#define LIGHT_SUN 2
// Table of a profile: intensities relative to the largest, at angles from the axis of 0 to 180 degrees, and around it
// from the vector across, where the first column repeats as the last.
#define PROFILE_ROWS 181
#define PROFILE_COLUMNS 73
// Most lights of a scene.
#define MOST_LIGHTS 128
// In place of the texel of a light of the panorama that a ray is aimed at: of the first light.
#define LIGHT_TEXEL 0x7fffff00

// A direction towards a light.
typedef struct {
    int light;          // index; -1: none shines here
    float3 wi;
    float distance;     // to the point aimed at, metres
    float weight;       // irradiance on a plane across wi per intensity, over the density
} LightSample;

// Return the intensity of a sphere in direction d, from the light, relative to its axis.
static inline float light_falloff(const VirtualLights lights, __global const float4 *row, float3 d)
{
    const float cosine = dot(row[2].xyz, d);
    const float spot = clamp(cosine * row[3].w + row[4].w, 0.0f, 1.0f);
    const int first = (int)row[2].w;
    if (first < 0)
        return spot * spot;
    const float from_axis = acos(clamp(cosine, -1.0f, 1.0f)) * ((PROFILE_ROWS - 1) / IPRT_PI);
    const float turn = atan2(dot(row[4].xyz, d), dot(row[3].xyz, d)) * (0.5f / IPRT_PI);
    const float around = (turn - floor(turn)) * (PROFILE_COLUMNS - 1);
    const int y = min((int)from_axis, PROFILE_ROWS - 2), x = min((int)around, PROFILE_COLUMNS - 2);
    __global const float *at = lights.profiles + (first + y) * PROFILE_COLUMNS + x;
    return mix(mix(at[0], at[1], around - x), mix(at[PROFILE_COLUMNS], at[PROFILE_COLUMNS + 1], around - x),
               from_axis - y);
}

// Least cosine between a normal and a light for choosing it: a clearcoat with a normal of its own reflects light from below
// the shading normal.
#ifdef COAT_NORMALS
#define LEAST_FACING 0.1f
#else
#define LEAST_FACING 0.0f
#endif

// Return a weight for choosing a light at x with normal n: 0 only where none of its light arrives.
static inline float light_importance(const VirtualLights lights, __global const float4 *row, float3 x, float3 n)
{
    const int kind = (int)row[1].w;
    if (kind == LIGHT_SUN)
        return row[5].z * fmax(row[0].w - dot(n, row[2].xyz), LEAST_FACING);
    const float3 away = row[0].xyz - x;
    const float distance2 = fmax(dot(away, away), 1e-12f), inverse = rsqrt(distance2);
    const float reach = kind == LIGHT_RECTANGLE ? length(row[5].xy) : row[0].w;
    const float facing = clamp((dot(n, away) + reach) * inverse, LEAST_FACING, 1.0f);
    const float emitted = kind == LIGHT_RECTANGLE
        ? fmin(fmax(-dot(row[2].xyz, away), 0.0f) * inverse, 1.0f)
        : light_falloff(lights, row, -inverse * away);
    return row[5].z * emitted * facing / fmax(distance2, reach * reach);
}

// Sample the point of a light and its weight; u in [0, 1)^2.
static inline void aim_at_light(const VirtualLights lights, int index, float3 x, float2 u, LightSample *sample)
{
    __global const float4 *row = lights.rows + LIGHT_ROWS * index;
    const int kind = (int)row[1].w;
    sample->light = index;
    if (kind == LIGHT_RECTANGLE) {
        const float3 across = (2.0f * u.x - 1.0f) * row[5].x * row[3].xyz;
        const float3 away = row[0].xyz + across + (2.0f * u.y - 1.0f) * row[5].y * row[4].xyz - x;
        const float distance2 = fmax(dot(away, away), 1e-12f);
        sample->distance = sqrt(distance2);
        sample->wi = away / sample->distance;
        // On the axis the area counts in full: L A = I.
        sample->weight = fmax(-dot(row[2].xyz, sample->wi), 0.0f) / distance2;
        return;
    }
    const int sun = kind == LIGHT_SUN;
    const float3 away = sun ? -row[2].xyz : row[0].xyz - x;
    const float distance2 = fmax(dot(away, away), 1e-12f), distance = sqrt(distance2);
    const float3 middle = away / distance;
    const float sine = fmin(sun ? row[0].w : row[0].w / distance, 1.0f);
    // 1 - cos without cancellation.
    const float height = sine * sine / (1.0f + sqrt(1.0f - sine * sine)), below = u.x * height;
    const float2 beside = sqrt(fmax(below * (2.0f - below), 0.0f)) * unit_circle(u.y);
    sample->wi = frame_to_world(build_frame(middle), (float3)(beside, 1.0f - below));
    // The radiance I / (pi r^2) times the cone's solid angle, which is I / d^2 for points.
    sample->weight = 2.0f / (1.0f + sqrt(1.0f - sine * sine));
    if (!sun)
        sample->weight *= light_falloff(lights, row, -middle) / fmax(distance2, row[0].w * row[0].w);
    sample->distance = sun ? INFINITY : fmax(distance - row[0].w, 0.0f);
}

// Sample a light from x with normal n; u in [0, 1)^2, `which` in [0, 1).
static inline LightSample sample_virtual_light(const VirtualLights lights, float3 x, float3 n, float2 u, float which)
{
    LightSample sample = {-1, n, 0.0f, 0.0f};
    float total = 0.0f, chosen = 0.0f;
    for (int i = 0; i < lights.count; i++)
        total += light_importance(lights, lights.rows + LIGHT_ROWS * i, x, n);
    float left = which * total;
    for (int i = 0; i < lights.count && left >= 0.0f; i++) {
        const float importance = light_importance(lights, lights.rows + LIGHT_ROWS * i, x, n);
        // Rounding may leave a remainder: the last light that shines here takes it.
        if (importance > 0.0f) {
            sample.light = i;
            chosen = importance;
        }
        left -= importance;
    }
    if (sample.light >= 0) {
        aim_at_light(lights, sample.light, x, u, &sample);
        sample.weight *= total / chosen;
    }
    return sample;
}

// Return the intensity of a light on its axis.
static inline float3 light_intensity(const VirtualLights lights, int light)
{
    return lights.rows[LIGHT_ROWS * light + 1].xyz;
}

// Real surfaces aim a ray at these lights with each of their other rays.
#define RAYS_PER_SAMPLE 2
#else
#define RAYS_PER_SAMPLE 1
#endif
