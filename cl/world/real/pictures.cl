// Panorama radiance, three floats a texel.
//
//   kernel         in                                  out
//   load_texels    color, the previous frame's texels  texels; sums by strips
//   sum_strips     sums by strips                      sums by blocks, for the flux and its change
//
// Where the device shares the host's memory, load_texels sums the decoded picture in place. Otherwise it is
// launched for some rows at a time, so that the device never holds the decoded picture besides the texels.
#include "maths/maths.h"
#include "world/real/strips.h"

// Floats that a work item takes at a time, whatever channels they are.
#ifdef WIDE
#define PIECE 16
typedef float16 Piece;
#define load_piece(from) vload16(0, from)
#define store_piece(values, to) vstore16(values, 0, to)
#else
#define PIECE 4
typedef float4 Piece;
#define load_piece(from) vload4(0, from)
#define store_piece(values, to) vstore4(values, 0, to)
#endif

// Rows whose sums are added before the host reads them.
#define BLOCK 32

typedef struct {
    Piece apart;
    Piece larger;
    Piece all;
} Sums;

static inline void add(Sums *sums, Piece now, Piece old)
{
    sums->apart += fabs(now - old);
    sums->larger += fmax(now, old);
    sums->all += now;
}

static inline float total_of(const Piece *piece)
{
    float sum = 0.0f;
    for (int i = 0; i < PIECE; i++)
        sum += ((const float *)piece)[i];
    return sum;
}

// Return a piece of one float, and zeros.
static inline Piece single(float value)
{
    Piece piece = (Piece)(0.0f);
    ((float *)&piece)[0] = value;
    return piece;
}

static inline Sums mapped(__global const float *restrict color, __global const float4 *restrict map,
                          __global const float *before, __global float *texels,
                          __global float *stored, int count)
{
    Sums sums = {(Piece)(0.0f), (Piece)(0.0f), (Piece)(0.0f)};
    for (int i = 0; i < count; i++) {
        const float3 seen = vload3(i, color);
        const float3 now = fmax(
            (float3)(dot(map[0].xyz, seen), dot(map[1].xyz, seen), dot(map[2].xyz, seen)), 0.0f);
        const float3 old = before ? vload3(i, before) : now;
        add(&sums, single(now.x), single(old.x));
        add(&sums, single(now.y), single(old.y));
        add(&sums, single(now.z), single(old.z));
        vstore3(now, i, texels);
        if (stored)
            vstore3(seen, i, stored);
    }
    return sums;
}

static inline Sums plain(__global const float *restrict color, __global const float *before,
                         __global float *texels, int floats)
{
    Sums sums = {(Piece)(0.0f), (Piece)(0.0f), (Piece)(0.0f)};
    const int whole = floats / PIECE * PIECE;
    for (int i = 0; i < whole; i += PIECE) {
        const Piece now = load_piece(color + i);
        add(&sums, now, before ? load_piece(before + i) : now);
        if (texels)
            store_piece(now, texels + i);
    }
    for (int i = whole; i < floats; i++) {
        add(&sums, single(color[i]), single(before ? before[i] : color[i]));
        if (texels)
            texels[i] = color[i];
    }
    return sums;
}

__kernel void load_texels(
    const int width,
    const int rows,                          // in `color`
    const int first,                         // index of the first row, in the other pictures
    const int done,                          // rows that were loaded before
    __global const float *restrict color,    // 3 a texel
    __global const float4 *restrict map,     // 3 rows of `Frame.color_map`, or null; w is 0
    __global const float *before,            // of the previous frame, possibly `texels`; or null
    __global float *texels,                  // out, or null where `color` is used in place
    __global float *stored,         // out: color itself beside mapped texels, or null
    __global float4 *restrict sums)          // out, per strip: sums over texels and channels of
                                             // differences, of the larger values, and of all;
                                             // w: 0 where no texel differs, else 1
{
    const int strip = get_global_id(0), y = get_global_id(1);
    const int strips = (width + STRIP - 1) / STRIP;
    if (strip >= strips || y < done || y >= rows)
        return;
    const int own = 3 * (y * width + strip * STRIP), at = own + 3 * first * width;
    const int count = min(STRIP, width - strip * STRIP);
    __global const float *old = before ? before + at : before;
    __global float *out = texels ? texels + at : texels;
    const Sums found = map ? mapped(color + own, map, old, out, stored ? stored + at : stored, count)
                           : plain(color + own, old, out, 3 * count);
    const float apart = total_of(&found.apart);
    sums[(first + y) * strips + strip] = (float4)(
        apart, total_of(&found.larger), total_of(&found.all), before && apart == 0.0f ? 0.0f : 1.0f);
}

__kernel void sum_strips(
    const int strips,                       // of a row
    const int rows,
    __global const float *restrict weight,  // of each row, proportional to its texels' solid angle
    __global const float4 *restrict sums,   // from load_texels
    __global float4 *restrict blocks)       // out: sums over BLOCK rows of a strip
{
    const int strip = get_global_id(0), block = get_global_id(1);
    if (strip >= strips || block * BLOCK >= rows)
        return;
    float4 sum = (float4)(0.0f);
    for (int y = block * BLOCK; y < min((block + 1) * BLOCK, rows); y++)
        sum += weight[y] * sums[y * strips + strip];
    blocks[block * strips + strip] = sum;
}
