// Leading parameters of the kernels that trace listed pixels, and the pixel of a work item.
#ifndef IPRT_TRACED_H
#define IPRT_TRACED_H

#include "gbuffer/planes.h"
#include "maths/list.h"
#include "maths/rng.h"
#include "maths/tracing.h"

// Passed by traced_arguments() of iprt/trace/tracers.py. `list` holds y * width + x of `count` pixels,
// `guide` 7 planes (lib/gbuffer/guide.h), `view` lib/gbuffer/view.h; `rays` is the number per pixel.
#define TRACED_PARAMETERS                                                                          \
    const int width, const int height, const int rays, const int frame_seed,                       \
        __global const int *restrict list, __global const int *restrict count,                     \
        __global const float *restrict guide, __global const float *restrict view

// Return the index of a listed pixel into padded planes.
static inline int pixel_of(int listed, int width)
{
    return plane_index(listed % width, listed / width, width);
}

// Pixel of this work item; `stream` makes the random numbers of kernels independent.
#define TRACED_PIXEL(item, stream)                                                                 \
    traced_pixel(READ_AGAIN(list + item), width, height, guide, frame_seed, stream)

typedef struct {
    int x;
    int y;
    int pixel;   // index into padded planes of `size`
    int size;
    float3 n;    // normal
    float3 p;    // position, metres
    int id;      // of the surface, from 1 on
    uint seed;
} TracedPixel;

static inline TracedPixel traced_pixel(int listed, int width, int height,
                                       __global const float *restrict guide, int frame_seed,
                                       uint stream)
{
    TracedPixel at;
    at.x = listed % width;
    at.y = listed / width;
    at.pixel = pixel_of(listed, width);
    at.size = plane_size(width, height);
    at.n = load_planes(guide, at.size, at.pixel);
    at.p = load_planes(guide + 3 * at.size, at.size, at.pixel);
    at.id = (int)guide[6 * at.size + at.pixel];
    at.seed = hash_combine(hash_combine((uint)listed, stream), (uint)frame_seed);
    return at;
}

#endif
