// Relighting ratio of real surfaces, E_RV / E_R (IPRT Eq. 2; Algorithm 1, UpdateGbuffer): the factor of the
// captured radiance where objects cast shadows and light.
//
//   in   guide (7 planes, guide.h), color (3 planes: L_cam), signal (6 planes): E_R rgb, E_RV rgb,
//        or, with -DDELTA, blocked / E_R rgb, bounce / E_R rgb, and the cache that holds E_R
//        (irradiance.h): L = L_cam (1 + (bounce - blocked) / E_R); with -DNOISE also the variance of the
//        filtered signal (residual.h)
//   out  ratio, float4 per pixel (height x width, no border, row 0 the top), w = 1; exactly 1 where
//        E_R and E_RV are equal or nothing is blocked or bounced, where E_R is black or not finite,
//        and where no real surface is lit (no surface, or an opening: id 0); not written outside
//        the listed tiles
//
// No diffuse surface reflects more than it receives. Where the camera saw more than E_R, the excess is due to
// light that the panorama lacks (a clipped window) or to a highlight. Objects are assumed to block the same
// share of it as of the known light, without color, and never to add to it. Otherwise such spots would
// brighten themselves by way of objects near them.
#include "gbuffer/batch.h"
#include "gbuffer/guide.h"
#include "filter/residual.h"
#include "world/real/irradiance.h"

// Upper bound of the ratio. A larger one occurs where E_R is small and noisy, and where the captured color
// is too dark to be reliable.
#define MAX_RATIO 4.0f

// Relative changes below this are applied without a lookup of E_R.
#define SLIGHT 0.004f
// Relative changes above these get a ray for every fourth pixel, and for every pixel: noise is proportional
// to the change.
#define FAINT 0.015f
#define STRONG 0.06f

static inline float channel_ratio(
    float real, float both, float seen, float passing, float explained, float black)
{
    float unexplained = fmax(seen - real, 0.0f);
    float ratio = (both + passing * unexplained) / (real + unexplained);
    ratio = mix(passing, ratio, explained);
    bool usable = real > black && real < 1e30f && fabs(both) < 1e30f && both != real;
    return usable ? fmin(fmax(ratio, 0.0f), MAX_RATIO) : 1.0f;
}

__kernel void relight(
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    __global const float *restrict guide,  // 7 planes
    __global const float *restrict signal, // 6 planes
    __global const float *restrict color, // 3 planes
    __global float4 *restrict ratio,       // out: float4 per pixel
    const IrradianceCache cache,
    __global float *restrict touched,      // in, out: 1 plane, frames for which pixels are traced
                                           // densely: more where objects change more
    STORED_IN variance,                    // -D NOISE: 1 plane, of the signal's guide scalar
    int width,
    int height)
{
    TILE_ITEM;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    float3 seen = load_planes(color, size, p);
    const float black = cache.black;
#ifdef DELTA
#ifdef NOISE
    const Filtered filtered = {signal, variance, guide, size, plane_stride(width)};
    const Change change = settled_change(filtered, p);
    float3 blocked = change.blocked, bounce = change.bounce;
#else
    float3 blocked = load_planes(signal, size, p), bounce = load_planes(signal + 3 * size, size, p);
#endif
    // Only filtered values are clamped: single samples may exceed the physical range.
    blocked = clamp(blocked, 0.0f, 1.0f);
    bounce = fmax(bounce, 0.0f);
    const float3 larger = fmax(blocked, bounce);
    // For most pixels of most views, the change is too small for E_R to matter.
    const int slight = fmax(larger.x, fmax(larger.y, larger.z)) < SLIGHT;
    float3 real = (float3)(0.0f);
    if (guide[GUIDE_ID * size + p] > 0.0f && !slight)
        real = cached_irradiance(cache, load_planes(guide + GUIDE_POSITION * size, size, p),
                                 load_planes(guide + GUIDE_NORMAL * size, size, p));
    float3 both = real * (1.0f - blocked + bounce);
#else
    float3 real = load_planes(signal, size, p), both = load_planes(signal + 3 * size, size, p);
#endif
    float passing = fmin(fmax(luminance(both) / fmax(luminance(real), black), 0.0f), 1.0f);
    float3 shares = real / fmax(fmax(real, seen), black);
    float explained = clamp(fmin(shares.x, fmin(shares.y, shares.z)), 0.0f, 1.0f);
    float4 result = (float4)(
        channel_ratio(real.x, both.x, seen.x, passing, explained, black),
        channel_ratio(real.y, both.y, seen.y, passing, explained, black),
        channel_ratio(real.z, both.z, seen.z, passing, explained, black), 1.0f);
#ifdef DELTA
    if (slight)
        result = (float4)(1.0f - blocked + bounce, 1.0f);
#endif
    if (!(guide[GUIDE_ID * size + p] > 0.0f))
        result = (float4)(1.0f);
    ratio[y * width + x] = result;
#ifdef DELTA
    const float4 apart = fabs(result - 1.0f);
    const float most = fmax(apart.x, fmax(apart.y, apart.z));
    if (most > FAINT)
        touched[p] = fmax(touched[p], most > STRONG ? STRONG_FRAMES : TOUCHED_FRAMES);
#endif
}
