// Layout of view-space images: planes of float, one per channel, each with a border of PLANE_PAD pixels on
// all sides, so that filters read past the edge without clamping. The border of a depth plane is 0 (no
// surface) and stays 0.
//
// Planes start PLANE_SHIFT floats more than a multiple of PLANE_WAY apart. Without the shift, all values of
// a pixel of a 512x512 view fall into one set of a CPU's L1 cache. A set holds 8 lines, and a level of the
// à-trous filter takes 1.7 times as long.
#pragma once

#define PLANE_PAD 32   // reach of the widest à-trous level: two taps of stride 16
#define PLANE_WAY 1024 // floats in one way of an L1 cache
#define PLANE_SHIFT 64 // sixteen planes are spread over all sets

// Precedes loops over neighbouring pixels. -D WIDE: unrolled, as PoCL vectorizes only kernels without
// loops. GPU compilers would then load all neighbours at once into registers.
#ifdef WIDE
#define TAP_LOOP _Pragma("unroll")
#else
#define TAP_LOOP _Pragma("unroll 1")
#endif

static inline int plane_stride(int width) { return width + 2 * PLANE_PAD; }
static inline int plane_size(int width, int height)
{
    const int pixels = plane_stride(width) * (height + 2 * PLANE_PAD);
    return (pixels + PLANE_WAY - 1) / PLANE_WAY * PLANE_WAY + PLANE_SHIFT;
}
static inline int plane_index(int x, int y, int width)
{
    return (y + PLANE_PAD) * plane_stride(width) + x + PLANE_PAD;
}

// Run PUT for each index at which the border repeats pixel p, in column x, from across the seam: `seam` is
// PLANE_PAD in equirect views, else 0. -DVIEW_NARROW: the border may be wider than the view, and then
// repeats it more than once.
#ifdef VIEW_NARROW
#define AT_BORDER(PUT)                                                                             \
    for (int turns = 1; turns < (seam + width - 1) / width + 1; turns++) {                         \
        if (x - turns * width >= -seam)                                                            \
            PUT(p - turns * width);                                                                \
        if (x + turns * width < width + seam)                                                      \
            PUT(p + turns * width);                                                                \
    }
#else
#define AT_BORDER(PUT)                                                                             \
    if (x < seam)                                                                                  \
        PUT(p + width);                                                                            \
    if (x >= width - seam)                                                                         \
        PUT(p - width);
#endif

#define PUT(at) plane[at] = value

// Write the value of pixel p, in column x, to the border.
static inline void store_border(
    __global float *restrict plane, int p, int x, int width, int seam, float value)
{
    AT_BORDER(PUT)
}

// Write a value to the pixel and the border, so that neighbours need no wrapping.
static inline void store_wrapped(
    __global float *restrict plane, int p, int x, int width, int seam, float value)
{
    PUT(p);
    store_border(plane, p, x, width, seam, value);
}

#undef PUT

// Write the pixels of a row from column `first` to `end`, which a lane loop has written, to the border.
static inline void wrap_row(__global float *restrict plane, int first, int end, int y, int width, int seam)
{
    for (int x = first; seam && x < end; x++) {
        const int p = plane_index(x, y, width);
        store_border(plane, p, x, width, seam, plane[p]);
    }
}

// Return the values of three planes at `pixel`.
static inline float3 load_planes(__global const float *restrict planes, int size, int pixel)
{
    return (float3)(planes[pixel], planes[size + pixel], planes[2 * size + pixel]);
}

static inline void store_planes(__global float *restrict planes, int size, int pixel, float3 value)
{
    planes[pixel] = value.x;
    planes[size + pixel] = value.y;
    planes[2 * size + pixel] = value.z;
}
