// The visible virtual surface of a traced pixel.
#pragma once

#include "trace/traced.h"
#include "world/brdf.h"

// Return metalness and alpha at a pixel of padded planes; 0 if no material needs them.
static inline float2 seen_finish(const Surfaces surfaces, uint pixel)
{
#ifdef PRINCIPLED
    return (float2)(surfaces.metallic[pixel], surfaces.roughness[pixel]);
#else
    return (float2)(0.0f);
#endif
}

// Return the index of the material at a pixel, of its variant where there are any.
static inline int seen_material(const Surfaces surfaces, const TracedPixel at)
{
#ifdef VARIANTS
    return (int)surfaces.variant[at.pixel] - 1;
#else
    return at.id - 1;
#endif
}
