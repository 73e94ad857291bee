// Leading parameters of the kernels that trace listed pixels, and the pixel of a work item.
#pragma once

#include "gbuffer/guide.h"
#include "maths/listed_items.h"
#include "maths/rng.h"
#include "maths/kernel_attributes.h"
#include <iprt.trace.tracer_arguments>

// Return the index of a listed pixel into padded planes.
static inline int pixel_of(int listed, int width)
{
    return plane_index(listed % width, listed / width, width);
}

typedef struct {
    int x;
    int y;
    int pixel;   // index into padded planes of `size`
    int size;
    float3 n;    // normal
    float3 p;    // position, metres
    int id;      // of the surface, from 1 on; negative in the guide at probes (filter/influence.cl)
    uint seed;
} TracedPixel;

// Return load_planes(). Compilers split sums of signed indices, and then keep the offset of each plane in a pair
// of registers along each ray.
static inline float3 load_traced(__global const float *restrict planes, uint size, uint pixel)
{
    return (float3)(planes[pixel], planes[size + pixel], planes[2 * size + pixel]);
}

// Return the pixel of item number `item`; `stream` makes the random numbers of kernels independent.
static inline TracedPixel traced_pixel(const Pixels pixels, int item, uint stream)
{
    const int listed = READ_AGAIN(pixels.list + item), width = pixels.width;
    TracedPixel at;
    at.x = listed % width;
    at.y = listed / width;
    at.pixel = pixel_of(listed, width);
    at.size = plane_size(width, pixels.height);
    const uint size = at.size, pixel = at.pixel;
    at.n = load_traced(pixels.guide, size, pixel);
    at.p = load_traced(pixels.guide, size, 3 * size + pixel);
    at.id = abs((int)pixels.guide[6 * size + pixel]);
    at.seed = hash_combine(hash_combine((uint)listed, stream), (uint)pixels.frame_seed);
    return at;
}

// Store two sums of radiance or irradiance, times `scale`, as the six planes of a signal.
static inline void store_signal(__global float *restrict signal, const TracedPixel at, float3 scale,
                                float3 first, float3 second)
{
    store_planes(signal, at.size, at.pixel, scale * first);
    store_planes(signal + 3 * at.size, at.size, at.pixel, scale * second);
}
