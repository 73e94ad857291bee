// SIMD lanes: a work item processes LANES adjacent texels of a row, as the elements of vectors or in a
// LANE_LOOP.
//
// -D WIDE: 16 lanes, for runtimes such as PoCL that fill vector units only from vectors in the source, at
// least in kernels with more than a few branches. Otherwise one: GPUs have a lane per work item.
#pragma once

#define WIDE_LANES 16

#ifdef WIDE
#define LANES WIDE_LANES
typedef float16 floats;
typedef int16 ints;
#define load_floats(from) vload16(0, from)
#define store_floats(values, to) vstore16(values, 0, to)
#define bits_of(values) as_int16(values)
// Precedes a loop over the texels of a work item, which becomes vectors. Its code is of scalars, without
// conditional loads: | in place of ||. PoCL merges similar operations of a work item into short vectors
// before it vectorizes over work items, which it then no longer can. It vectorizes such a loop before.
#define LANE_LOOP _Pragma("clang loop vectorize(assume_safety) unroll(disable)")
#else
#define LANES 1
typedef float floats;
typedef int ints;
#define load_floats(from) (*(from))
#define store_floats(values, to) (*(to) = (values))
#define bits_of(values) as_int(values)
#define LANE_LOOP
#endif

// Define row y and columns `first` to `end` of a work item in a picture; work items outside return.
#define LANES_ITEM(width, height)                                                                  \
    const int first = get_global_id(0) * LANES, y = get_global_id(1);                              \
    if (first >= (width) || y >= (height))                                                         \
        return;                                                                                    \
    const int end = min(first + LANES, (width))

// Return a where the comparison `chosen` holds, else b.
static inline floats either(ints chosen, floats a, floats b)
{
    return select(b, a, chosen);
}

static inline float lane(const floats *values, int number)
{
    return ((const float *)values)[number];
}

// Return the texels to the right, and to the left, of the ones at x in a line that wraps around.
static inline floats load_east(__global const float *restrict line, int x, int width)
{
#ifdef WIDE
    floats values = load_floats(line + x + 1);
    if (x + LANES >= width)
        ((float *)&values)[width - 1 - x] = line[0];
    return values;
#else
    return line[x + 1 < width ? x + 1 : 0];
#endif
}

static inline floats load_west(__global const float *restrict line, int x, int width)
{
#ifdef WIDE
    floats values = load_floats(line + x - 1);
    if (x == 0)
        ((float *)&values)[0] = line[width - 1];
    return values;
#else
    return line[x > 0 ? x - 1 : width - 1];
#endif
}
