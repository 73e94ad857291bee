// Area lights: discs that replace regions of the panorama (iprt/methods/dvct/area_lights.py), and their shadow
// maps of the space around the objects, with and without the objects.
//
// A map covers a spherical cap around the direction to the objects, in Lambert's azimuthal equal-area projection.
#pragma once

#include "maths/equirect.h"
#include "maths/maths.h"
#include "maths/sampling.h"
#include "maths/kernel_attributes.h"
#include <iprt.methods.dvct.delta_world>

#define AREA_LIGHT_ROWS 4
// Depth bias of shadow map lookups, in voxels.
#define VOXEL_SLACK 1.5f
// Largest tangent of half the aperture of a cone towards a light.
#define MOST_SLOPE 1.7f

typedef struct {
    float3 position;
    float squared_radius;
    float3 normal;
    float3 power;       // radiance times area, along the normal
    float3 axis;        // direction to the objects
    float cap;          // sine of half the angular radius of the map around the axis
} AreaLight;

static inline AreaLight area_light(__global const float4 *restrict rows, int number)
{
    rows += AREA_LIGHT_ROWS * number;
    return (AreaLight){rows[0].xyz, rows[0].w, rows[1].xyz, rows[2].xyz, rows[3].xyz, rows[3].w};
}

// Return the irradiance / pi of an unoccluded light at x with normal n. It is exact on the axis of the disc.
static inline float3 light_irradiance(const AreaLight light, float3 x, float3 n)
{
    const float3 away = light.position - x;
    const float squared = dot(away, away);
    const float cosines = fmax(dot(n, away), 0.0f) * fmax(-dot(light.normal, away), 0.0f);
    return light.power
        * (cosines / (IPRT_PI * fmax(squared, 1e-12f) * (squared + light.squared_radius)));
}

// Return the map coordinates, in texels, of a direction from the light.
static inline float2 map_place(const AreaLight light, float3 d, int side)
{
    const float3 v = frame_to_local(build_frame(light.axis), d);
    const float2 half_angle = v.xy / sqrt(fmax(2.0f + 2.0f * v.z, 1e-12f));
    return (0.5f + 0.5f / light.cap * half_angle) * (float)side;
}

// Return the direction at map coordinates; 0 outside the projection.
static inline float3 map_direction(const AreaLight light, float2 place, int side)
{
    const float2 half_angle = (2.0f / side * place - 1.0f) * light.cap;
    const float squared = dot(half_angle, half_angle);
    if (squared > 1.0f)
        return (float3)(0.0f);
    const float2 across = 2.0f * sqrt(1.0f - squared) * half_angle;
    return frame_to_world(build_frame(light.axis),
                          (float3)(across.x, across.y, 1.0f - 2.0f * squared));
}

// Return the visibility of the light at x: past real surfaces, and past real surfaces and objects. `slack` is
// the depth bias in metres; half the width of a texel is added.
static inline float2 light_passing(const AreaLights lights, int number, const AreaLight light, float3 x,
                                   float slack)
{
    const float3 away = x - light.position;
    const float distance = length(away);
    const float2 place =
        map_place(light, away / fmax(distance, 1e-12f), lights.side) - (float2)(0.5f);
    const float2 low = floor(place), part = place - low;
    const int x0 = (int)low.x, y0 = (int)low.y, last = lights.side - 2;
    if (x0 < 0 || y0 < 0 || x0 > last || y0 > last)
        return (float2)(1.0f);
    // A texel is about 4 cap / side radians wide.
    const float before = distance * (1.0f - 2.0f * light.cap / lights.side) - slack;
    __global const float2 *map = lights.maps + (number * lights.side + y0) * lights.side + x0;
    float2 passing = (float2)(0.0f);
    #pragma unroll
    for (int i = 0; i < 4; i++) {
        const float2 met = map[(i >> 1) * lights.side + (i & 1)];
        const float weight = (i & 1 ? part.x : 1.0f - part.x) * (i & 2 ? part.y : 1.0f - part.y);
        const float real = met.y > before ? weight : 0.0f;
        passing += (float2)(real, met.x > before ? real : 0.0f);
    }
    return passing;
}
