// Equirect mapping of the scene format: row 0 is the zenith (+Y), the image centre looks along -Z, and +X
// is to its right. uv in [0, 1): column / width, row / height.
#pragma once

#include "maths/maths.h"

#define IPRT_PI 3.14159265358979f

// Return the unit direction of uv.
static inline float3 equirect_direction(float u, float v)
{
    float phi = (u - 0.5f) * (2.0f * IPRT_PI);
    float theta = v * IPRT_PI;
    float sin_theta = sin(theta);
    return (float3)(sin_theta * sin(phi), cos(theta), -sin_theta * cos(phi));
}

// Return the unit direction of a texel's centre.
static inline float3 texel_direction(int column, int row, int width, int height)
{
    return equirect_direction((column + 0.5f) / width, (row + 0.5f) / height);
}

// Return the uv of a direction of any length.
static inline float2 equirect_uv(float3 d)
{
    float u = fast_atan2(d.x, -d.z) * (0.5f / IPRT_PI) + 0.5f;
    float v = fast_atan2(sqrt(d.x * d.x + d.z * d.z), d.y) * (1.0f / IPRT_PI);
    return (float2)(u - floor(u), v);
}

// Return the row-major index of the texel at uv.
static inline int equirect_texel(float2 uv, int width, int height)
{
    return min((int)(uv.y * height), height - 1) * width + min((int)(uv.x * width), width - 1);
}
