// Sums over the rays of a pixel, in memory: GPUs would hold them in registers along each ray, where they allow
// fewer rays at a time.
#pragma once

// Three sums.
typedef volatile float Sums[3];

static inline void clear_sums(volatile float *sums)
{
    sums[0] = sums[1] = sums[2] = 0.0f;
}

static inline void add_to(volatile float *sums, float3 value)
{
    sums[0] += value.x;
    sums[1] += value.y;
    sums[2] += value.z;
}

static inline float3 summed(const volatile float *sums)
{
    return (float3)(sums[0], sums[1], sums[2]);
}
