// Deterministic, counter-based random numbers: a hash of the number's purpose (pixel, frame, bounce, seed).
// There is no state to carry.
#pragma once

// Return a bijective hash of x. Every input bit flips each output bit with probability 1/2 to within 0.2%
// (two rounds of xorshift-multiply; multipliers by C. Wellons' search, "lowbias32").
static inline uint hash_u32(uint x)
{
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    x ^= x >> 16;
    return x;
}

// Return the hash of the pair. It is not symmetric, and one-to-one in each argument for a fixed other one.
static inline uint hash_combine(uint seed, uint v)
{
    // hash_u32(0) is 0. The constant keeps (0, 0), the first pixel of the first frame, from mapping to it.
    return hash_u32(hash_u32(seed + 0x9e3779b9u) ^ v);
}

// Return x in [0, 1) from its upper 24 bits, all that a float holds, so that rounding never gives 1.
static inline float u01(uint x)
{
    return (float)(x >> 8) * (1.0f / 16777216.0f);
}
