// Gain of computed highlights (iprt/world/real/highlight_gain.py), in cells of CELL x CELL texels.
#pragma once

#include "maths/equirect.h"
#include "world/brdf.h"
#include "world/real/panorama.h"
#include <iprt.world.real.highlight>

#define CELL 8 // side of the cells in which highlights are compared with the panorama, texels

// Return the gain at `at`, in texels of the panorama; (0, 0) is its upper left corner.
static inline float3 gain_at(__global const float4 *restrict gain, int columns, int rows, float2 at)
{
    return equirect_bilinear((__global const float *)gain, 4, columns, rows,
                             at / ((float)CELL * (float2)((float)columns, (float)rows)));
}

// Return the share of a computed reflection in a real surface at p that the camera can have seen, for a
// panorama of that size. A conductor has no diffuse part to estimate it from.
static inline float3 seen_share(const Gloss gloss, const Material material, int width, int height, float3 p)
{
    const float2 texel = equirect_uv(p) * (float2)((float)width, (float)height);
    return material.kind == KIND_CONDUCTOR ? (float3)(1.0f) : gain_at(gloss.gain, gloss.columns, gloss.rows, texel);
}
