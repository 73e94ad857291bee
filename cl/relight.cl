// Relighting ratio of real surfaces, E_RV / E_R (IPRT Eq. 2; Algorithm 1, UpdateGbuffer): what
// the camera's radiance is multiplied by where objects cast shadows and light.
//
//   in   guide (7 planes, guide.h), signal (6 planes: E_R rgb, E_RV rgb), colour (3 planes: L_cam)
//   out  ratio, float4 per pixel (height x width, no border, row 0 the top), w = 1; exactly 1 where
//        E_R and E_RV are equal, where E_R is black or not finite, and where no real surface is lit
//        (nothing there, or an opening: id 0)
//
// No diffuse surface reflects more than it receives. Where the camera saw more than E_R, the rest
// came from light that the panorama does not hold (a clipped lamp) or shone at the camera only (a
// highlight). It is added to E_R and E_RV alike, as light that no object blocks; otherwise such
// spots would light themselves up by way of the objects near them.
#include "guide.h"

// Objects at most add light to a spot that was dark; beyond 4 a real surface's radiance is mostly
// noise of a small E_R, and its colour was captured too dark to be trusted.
#define MAX_RATIO 4.0f

inline float channel_ratio(float real, float both, float seen, float black)
{
    float unexplained = fmax(seen - real, 0.0f);
    float ratio = (both + unexplained) / (real + unexplained);
    bool usable = real > black && real < 1e30f && fabs(both) < 1e30f && both != real;
    return usable ? fmin(fmax(ratio, 0.0f), MAX_RATIO) : 1.0f;
}

__kernel void relight(
    __global const float *restrict guide,  // 7 planes
    __global const float *restrict signal, // 6 planes
    __global const float *restrict colour, // 3 planes
    __global float4 *restrict ratio,       // out: float4 per pixel
    float black,                           // E_R up to this counts as black
    int width,
    int height)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    float4 result = (float4)(channel_ratio(signal[p], signal[3 * size + p], colour[p], black),
                             channel_ratio(signal[size + p], signal[4 * size + p],
                                           colour[size + p], black),
                             channel_ratio(signal[2 * size + p], signal[5 * size + p],
                                           colour[2 * size + p], black),
                             1.0f);
    ratio[y * width + x] = guide[GUIDE_ID * size + p] > 0.0f ? result : (float4)(1.0f);
}
