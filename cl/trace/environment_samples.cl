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
    if (i >= samples_count || !lights_shine(lights))
        return;
    int column, row;
    const float rest = find_light_column(lights, (i + 0.5f) / samples_count, &column);
    const float across = find_light_row(lights, column, rest, &row);
    samples[i] = (float4)(unit_circle((column + across) / lights.size.x), light_edge(lights, row),
                          light_edge(lights, row + 1));
}
