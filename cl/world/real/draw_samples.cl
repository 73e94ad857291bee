// Samples of the panorama's real surfaces for learning their radiance: texels, about uniform over the
// sphere. Windows and the open sky are not surfaces.
//
// in   surface   lib/world/real/real.h
//      radiance  3 a texel
//      pose      3 x 4: from the capture centre's axes to the world's
// out  samples   SAMPLE_PARTS float4 each, in the axes of the world: position, width of the texel in
//                metres | normal, 1, or 0: no surface | radiance, 0
#include "world/real/learned.h"
#include "world/real/real.h"

__kernel void draw_samples(
    const int width,
    const int height,
    const int first,                            // index of the first sample since the start
    const int count,
    __global const float4 *restrict surface,
    __global const float *restrict radiance,
    __global const float *restrict pose,
    __global float4 *restrict samples)          // out
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const float2 u = sobol_2d(first + i, 0x6c6561u);
    const float v = acos(1.0f - 2.0f * u.y) * (1.0f / IPRT_PI);
    const int column = min((int)(u.x * width), width - 1), row = min((int)(v * height), height - 1);
    const int texel = row * width + column;
    const float4 plane = surface[texel];
    const float3 direction = texel_direction(column, row, width, height);
    const float inverse = dot(plane.xyz, direction);
    const float3 seen = vload3(texel, radiance);
    const int known = !((int)plane.w & (SURFACE_NONE | SURFACE_OPENING)) && inverse > 0.0f
        && is_finite(1.0f / inverse) && is_finite3(seen);
    const float distance = known ? 1.0f / inverse : 0.0f;
    const float3 normal = safe_normalize(-plane.xyz, (float3)(0.0f, 1.0f, 0.0f));
    __global float4 *sample = samples + SAMPLE_PARTS * i;
    sample[0] = (float4)(to_world(pose, distance * direction, 1.0f), distance * IPRT_PI / height);
    sample[1] = (float4)(to_world(pose, normal, 0.0f), known ? 1.0f : 0.0f);
    sample[2] = (float4)(known ? seen : (float3)(0.0f), 0.0f);
}
