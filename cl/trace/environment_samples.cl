// Samples of the environment, precomputed for each video frame: rays look them up instead of searching the
// table of lights (S. U. Mehta et al., "Filtering Environment Illumination for Interactive Physically-Based
// Rendering in Mixed Reality", EGSR 2015).
//
// in   lights         lib/world/real/lights.h
// out  samples        [samples_count]: cosine and sine of the azimuth (from -Z by half a turn), y of the
//                     upper and of the lower end of the sampled cell
#define DISTANT_ENVIRONMENT
#include "world/real/lights.h"

__kernel void environment_samples(
    const Lights lights,
    const int samples_count,
    __global float4 *restrict samples)
{
    const int i = get_global_id(0);
    if (i >= samples_count)
        return;
    const float x = (i + 0.5f) / samples_count;
    const float3 upper = sample_light(lights, (float2)(x, 0.0f));
    const float3 lower = sample_light(lights, (float2)(x, 1.0f));
    // At a pole, one end of the cell has no azimuth.
    const float3 wide = fabs(upper.y) < fabs(lower.y) ? upper : lower;
    const float radius = sqrt(wide.x * wide.x + wide.z * wide.z);
    samples[i] = (float4)(wide.z / radius, -wide.x / radius, upper.y, lower.y);
}
