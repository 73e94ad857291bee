// Layout of everything that lives on the view: planes of float, one per channel, each with a
// border of PLANE_PAD pixels on all sides, so that filters read past the edge without clamping.
// The border of a depth plane is 0 ("nothing here") and stays so.
#ifndef IPRT_PLANES_H
#define IPRT_PLANES_H

// PLANE_PAD is set by -D from iprt.gbuffer.layout.

// Before loops over neighbouring pixels. -D WIDE: unrolled, as PoCL vectorizes only kernels without
// loops. Compilers for GPUs would then load all neighbours at once, and hold them in registers.
// They also end at once where no neighbour counts, which PoCL would not vectorize either.
#ifdef WIDE
#define TAP_LOOP _Pragma("unroll")
#define TAPS_IF(COUNTED, TAPS) (TAPS)
#else
#define TAP_LOOP _Pragma("unroll 1")
#define TAPS_IF(COUNTED, TAPS) ((COUNTED) ? (TAPS) : 0)
#endif

static inline int plane_stride(int width) { return width + 2 * PLANE_PAD; }
static inline int plane_size(int width, int height) { return plane_stride(width) * (height + 2 * PLANE_PAD); }
static inline int plane_index(int x, int y, int width)
{
    return (y + PLANE_PAD) * plane_stride(width) + x + PLANE_PAD;
}

// In equirect views, PUT of each index at which the border repeats pixel p, in column x, from across
// the seam. -DVIEW_NARROW: the border is wider than the view, and repeats it more than once.
#if !defined(VIEW_EQUIRECT)
#define AT_BORDER(PUT)
#elif defined(VIEW_NARROW)
#define AT_BORDER(PUT)                                                                             \
    for (int turns = 1; turns <= (PLANE_PAD - 1) / width + 1; turns++) {                           \
        if (x - turns * width >= -PLANE_PAD)                                                       \
            PUT(p - turns * width);                                                                \
        if (x + turns * width < width + PLANE_PAD)                                                 \
            PUT(p + turns * width);                                                                \
    }
#else
#define AT_BORDER(PUT)                                                                             \
    if (x < PLANE_PAD)                                                                             \
        PUT(p + width);                                                                            \
    if (x >= width - PLANE_PAD)                                                                    \
        PUT(p - width);
#endif

#define PUT(at) plane[at] = value

// Writes the value of pixel p, in column x, to the border.
static inline void store_border(
    __global float *restrict plane, int p, int x, int width, float value)
{
    AT_BORDER(PUT)
}

// Writes it there and at the pixel itself, so that neighbours need no wrapping.
static inline void store_wrapped(
    __global float *restrict plane, int p, int x, int width, float value)
{
    PUT(p);
    store_border(plane, p, x, width, value);
}

#undef PUT

// Three planes' values at `pixel`.
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

#endif
