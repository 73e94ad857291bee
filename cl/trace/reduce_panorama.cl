// Level of the prefiltered panorama: means, weighted by solid angle, of the finer level or of the panorama
// itself.
//
// With `real_surface`, for the panorama itself: directions in which it shows neither a window nor the sky
// take the estimated radiance behind windows.
//
// in       source            3 a texel, [source_height * source_width], from texel `source_first` on
//          real_surface      lib/world/real/real.h
//          real_outside      3 a texel, [OUTSIDE_ROWS * 2 OUTSIDE_ROWS]
// in, out  texels            3 a texel, of all levels; this level begins at `first`
#include "world/real/panorama.h"
#include "world/real/real.h"

__kernel void reduce_panorama(
    const int source_width,
    const int source_height,
    const int source_first,
    const int width,
    const int height,
    const int first,
    __global const float4 *restrict real_surface,
    __global const float *restrict real_outside,
    __global const float *source,
    __global float *texels)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int x0 = x * source_width / width, x1 = ((x + 1) * source_width + width - 1) / width;
    const int y0 = y * source_height / height, y1 = ((y + 1) * source_height + height - 1) / height;
    float3 sum = (float3)(0.0f);
    float weights = 0.0f;
    for (int row = y0; row < y1; row++) {
        const float weight = sin((row + 0.5f) / source_height * IPRT_PI);
        for (int column = x0; column < x1; column++) {
            const int texel = source_first + row * source_width + column;
            float3 radiance = vload3(texel, source);
            if (real_surface && !((int)real_surface[texel].w & (SURFACE_OPENING | SURFACE_NONE))) {
                const float2 uv = ((float2)(column, row) + 0.5f)
                    / (float2)((float)source_width, (float)source_height);
                radiance = panorama_bilinear(real_outside, 2 * OUTSIDE_ROWS, OUTSIDE_ROWS, uv);
            }
            sum += weight * radiance;
            weights += weight;
        }
    }
    vstore3(sum / weights, first + y * width + x, texels);
}
