// Evaluation of models at samples, and their coverage of each sample (W. Lee et al. 2022, section IV-A).
//
// in   samples    world/real/draw_samples.cl
//      models     lib/world/real/learned.h
// out  predicted  weighted mean of the models' radiance (Eq. 4), sum of their weights; 0: none applies
//      greatest   largest weight of any model
#include "world/real/learned.h"

__kernel void ask_models(
    const int count,                            // of samples
    __global const float4 *restrict samples,
    const Learned learned,
    __global float4 *restrict predicted,        // out
    __global float *restrict greatest)          // out
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    __global const float4 *sample = samples + SAMPLE_PARTS * i;
    float weight;
    const float4 sum = ask_around(learned, sample[0].xyz, sample[1].xyz, &weight);
    predicted[i] = sum.w > 0.0f ? (float4)(sum.xyz / sum.w, sum.w) : (float4)(0.0f);
    greatest[i] = weight;
}
