// Radiance lookups in the panorama.
#ifndef IPRT_PANORAMA_H
#define IPRT_PANORAMA_H

// Bilinear radiance at uv: wraps around in azimuth, holds the first and last row at the poles.
static inline float3 panorama_bilinear(__global const float4 *restrict color, int width, int height,
                                float2 uv)
{
    const float x = uv.x * width - 0.5f, y = clamp(uv.y * height - 0.5f, 0.0f, height - 1.0f);
    const float left = floor(x), upper = floor(y);
    const float fx = x - left, fy = y - upper;
    int x0 = (int)left, x1 = x0 + 1;
    x0 = x0 < 0 ? x0 + width : x0;
    x1 = x1 >= width ? x1 - width : x1;
    const int row0 = (int)upper * width, row1 = min((int)upper + 1, height - 1) * width;
    const float4 top = mix(color[row0 + x0], color[row0 + x1], fx);
    const float4 bottom = mix(color[row1 + x0], color[row1 + x1], fx);
    return mix(top, bottom, fy).xyz;
}

#endif
