// The visible virtual surface of a traced pixel.
#pragma once

#include "trace/traced.h"
#include "world/brdf.h"

// Return the finish at a pixel of padded planes of `size`; 0 if no material needs it.
static inline Finish seen_finish(const Surfaces surfaces, uint size, uint pixel)
{
#if defined(COAT_NORMALS)
    return (Finish)(surfaces.metallic[pixel], surfaces.roughness[pixel], surfaces.coat_normal[pixel],
                    surfaces.coat_normal[size + pixel]);
#elif defined(PRINCIPLED)
    return (float2)(surfaces.metallic[pixel], surfaces.roughness[pixel]);
#else
    return (Finish)(0.0f);
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
