// Gain of computed highlights (iprt/world/real/highlight_gain.py), in cells of CELL x CELL texels.
#pragma once

#include "maths/equirect.h"
#include "world/brdf.h"
#include "world/real/panorama.h"
#include <iprt.world.real.highlight>

#define CELL 8 // side of the cells in which highlights are compared with the panorama, texels

// Return the gain at `at`, in texels of the panorama; (0, 0) is its upper left corner.
static inline float3 gain_at(
    __global const float4 *restrict gain, int columns, int rows, float2 size, float2 at)
{
    return equirect_bilinear((__global const float *)gain, 4, columns, rows, size, at / CELL / size);
}

// Return the share of a computed reflection in a real surface at p that the camera can have seen, for a
// panorama of that size. A conductor has no diffuse part to estimate it from.
static inline float3 seen_share(const Gloss gloss, const Material material, float2 size, float3 p)
{
    const float2 texel = equirect_uv(p) * size;
    return material.kind == KIND_CONDUCTOR
        ? (float3)(1.0f)
        : gain_at(gloss.gain, gloss.columns, gloss.rows, gloss.size, texel);
}
