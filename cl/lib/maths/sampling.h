// Sample points (Owen-scrambled Sobol) and directions.
//
// Points after B. Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020. The seed of a sequence
// is hash_combine(hash_combine(pixel, dimension pair), user seed). Its index is the sample's number over
// all frames. Any 2^k points that start at a multiple of 2^k put one point into every elementary interval
// of area 2^-k.
#pragma once

#include "maths/bits.h"
#include "maths/maths.h"
#include "maths/rng.h"

// Return the Owen scrambling of a bit-reversed number: each bit is flipped by a hash of the bits below it
// (Burley, Listing 2: the Laine-Karras permutation with the constants found there).
static inline uint scramble_reversed(uint x, uint seed)
{
    x += seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return x;
}

// Return the bit-reversed second dimension of the Sobol sequence. Its generator matrix is Pascal's triangle
// modulo 2, whose entry (k, j) is 1 iff the bits of k are a subset of the bits of j (Lucas). This is a sum
// over supersets, computed for all 32 bits at once in five steps instead of a loop over the index.
static inline uint sobol_1_reversed(uint index)
{
    index ^= (index >> 1) & 0x55555555u;
    index ^= (index >> 2) & 0x33333333u;
    index ^= (index >> 4) & 0x0f0f0f0fu;
    index ^= (index >> 8) & 0x00ff00ffu;
    index ^= index >> 16;
    return index;
}

// Return the shuffled index of a point, so that sequences with different seeds can be paired.
static inline uint shuffled_index(uint index, uint seed)
{
    return reverse_bits(scramble_reversed(reverse_bits(index), seed));
}

// Return point `index` of the 2D sequence `seed`, in [0, 1)^2.
static inline float2 sobol_2d(uint index, uint seed)
{
    index = shuffled_index(index, hash_u32(seed ^ 0xa511e9b3u));
    // The first dimension is the reversed index. Scrambling reverses it again, which gives the index.
    const uint x = scramble_reversed(index, hash_u32(seed ^ 0x63d83595u));
    const uint y = scramble_reversed(sobol_1_reversed(index), hash_u32(seed ^ 0x2f0b4c47u));
    return (float2)(u01(reverse_bits(x)), u01(reverse_bits(y)));
}

// Return point `index` of the 2D Sobol sequence for `dimensions`, a pair of dimensions of the integrand, in
// [0, 1)^2. Its order is shuffled, so that pairs are independent of each other. It is shifted by a vector
// that depends on `seed` (R. Cranley and T. N. L. Patterson, "Randomization of Number Theoretic Methods for
// Multiple Integration", SIAM Journal on Numerical Analysis 13(6), 1976).
static inline float2 rotated_sobol(uint index, uint dimensions, uint seed)
{
    index = shuffled_index(index, hash_u32(dimensions + 0x9e3779b9u));
    const uint shift = hash_combine(seed, dimensions);
    return (float2)(u01(reverse_bits(index) + shift),
                    u01(reverse_bits(sobol_1_reversed(index)) + hash_u32(shift ^ 0x2f0b4c47u)));
}

// Return point `index` of the 1D sequence `seed`, in [0, 1), for choices such as a lobe.
static inline float sobol_1d(uint index, uint seed)
{
    index = shuffled_index(index, hash_u32(seed ^ 0xa511e9b3u));
    return u01(reverse_bits(scramble_reversed(index, hash_u32(seed ^ 0x63d83595u))));
}

typedef struct {
    float3 x;
    float3 y;
    float3 z;   // the unit vector the frame is built around
} Frame;

// Return a right-handed orthonormal frame around a unit vector, without branches: Duff et al., "Building an
// Orthonormal Basis, Revisited", JCGT 6(1), 2017.
static inline Frame build_frame(float3 n)
{
    const float sign = copysign(1.0f, n.z);
    const float a = -1.0f / (sign + n.z);
    const float b = n.x * n.y * a;
    Frame frame;
    frame.x = (float3)(1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x);
    frame.y = (float3)(b, sign + n.y * n.y * a, -n.y);
    frame.z = n;
    return frame;
}

static inline float3 frame_to_world(Frame frame, float3 v)
{
    return v.x * frame.x + v.y * frame.y + v.z * frame.z;
}

static inline float3 frame_to_local(Frame frame, float3 v)
{
    return (float3)(dot(v, frame.x), dot(v, frame.y), dot(v, frame.z));
}

// Return a unit direction around +z with density cos/pi. z is never 0, so cos/pdf is always defined.
static inline float3 sample_cosine(float2 u)
{
    const float2 disk = sqrt(u.y) * unit_circle(u.x);
    return (float3)(disk.x, disk.y, sqrt(1.0f - u.y));
}
