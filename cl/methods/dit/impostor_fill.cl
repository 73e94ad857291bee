// Push-pull filling of the impostor's holes: means of known texels are pushed up a pyramid, and pulled down
// into the holes (K. Rohmer, J. Jendersie, T. Grosch, "Natural Environment Illumination", IEEE TVCG 2017,
// section 5). Level l of each face has ceil(side / 2^l) texels a side.
//
//   kernel        in                           out
//   push_texels   a level                      the next coarser one: means of known texels
//   pull_texels   a level, the coarser one     the holes of the level; at the finest, inverse distances
#include "maths/cube.h"

static inline int is_hole(float4 texel) { return texel.w < 0.0f; }

__kernel void push_texels(
    const int side,                      // of the finer level
    const int fine,                      // its first texel
    const int coarse,                    // first texel of the coarser level
    __global float4 *restrict texels)    // in, out: all levels; w < 0: a hole
{
    const int x = get_global_id(0), y = get_global_id(1), coarse_side = (side + 1) / 2;
    if (x >= coarse_side || y >= CUBE_FACES * coarse_side)
        return;
    const int face = y / coarse_side, row = y - face * coarse_side;
    float4 sum = (float4)(0.0f);
    float known = 0.0f;
    for (int i = 0; i < 4; i++) {
        const int column = 2 * x + (i & 1), line = 2 * row + (i >> 1);
        if (column >= side || line >= side)
            continue;
        const float4 texel = texels[fine + (face * side + line) * side + column];
        const float weight = is_hole(texel) ? 0.0f : 1.0f;
        sum += weight * texel;
        known += weight;
    }
    texels[coarse + y * coarse_side + x] =
        known > 0.0f ? sum / known : (float4)(0.0f, 0.0f, 0.0f, -1.0f);
}

// Return a texel of the coarser level. A hole occurs only at the coarsest level, of one texel per face: the
// mean of the other faces replaces it, or black sky if all are holes.
static inline float4 coarse_texel(__global const float4 *texels, int side, int face, int x, int y)
{
    float4 texel = texels[(face * side + clamp(y, 0, side - 1)) * side + clamp(x, 0, side - 1)];
    if (!is_hole(texel))
        return texel;
    float4 sum = (float4)(0.0f);
    float known = 0.0f;
    for (int other = 0; other < CUBE_FACES; other++) {
        texel = texels[other];
        sum += is_hole(texel) ? (float4)(0.0f) : texel;
        known += is_hole(texel) ? 0.0f : 1.0f;
    }
    return sum / fmax(known, 1.0f);
}

__kernel void pull_texels(
    const int side,                      // of the finer level
    const int fine,                      // its first texel
    const int coarse,                    // first texel of the coarser level
    __global float4 *texels,             // in, out: all levels
    __global float *restrict inverse)    // out at the finest level, else null
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= side || y >= CUBE_FACES * side)
        return;
    const int at = fine + y * side + x, coarse_side = (side + 1) / 2;
    const int face = y / side, row = y - face * side;
    float4 texel = texels[at];
    if (is_hole(texel)) {
        const int column = x / 2, line = row / 2;
        const int beside = x & 1 ? column + 1 : column - 1, over = row & 1 ? line + 1 : line - 1;
        __global const float4 *from = texels + coarse;
        texel = 0.5625f * coarse_texel(from, coarse_side, face, column, line)
            + 0.1875f * coarse_texel(from, coarse_side, face, beside, line)
            + 0.1875f * coarse_texel(from, coarse_side, face, column, over)
            + 0.0625f * coarse_texel(from, coarse_side, face, beside, over);
        texels[at] = texel;
    }
    if (inverse)
        inverse[at] = texel.w;
}
