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
// brighten themselves by way of objects near them. With -D SUN, the excess on surfaces that face the sun is due
// to it: the cached E_R leaves it out.
#include "gbuffer/batch.h"
#include "gbuffer/guide.h"
#include "filter/residual.h"
#include "maths/lanes.h"
#include "world/real/irradiance.h"
#include "world/real/sun.h"

// Largest reflectance of surfaces for the light that objects add. Below 1, so that the light that surfaces pass on to
// each other from picture to picture ends.
#ifdef ADDED_LIGHT
#define MOST_REFLECTED 0.9f
#else
#define MOST_REFLECTED 1.0f
#endif

// Relative changes below this are applied without a lookup of E_R.
#define SLIGHT 0.004f
// Relative changes above these get a ray for every fourth pixel, and for every pixel: noise is proportional
// to the change.
#define FAINT 0.015f
#define STRONG 0.06f

// Return the share of a channel's radiance that E_R explains.
static inline ALWAYS_INLINE float explained_share(float real, float seen, float black)
{
    const float most = MOST_REFLECTED * real;
    return most / fmax(fmax(most, seen), black);
}

static inline ALWAYS_INLINE float channel_ratio(
    float real, float both, float seen, float passing, float explained, float black, float clamp_at)
{
    const float unexplained = fmax(seen - real, 0.0f);
    const float known = (both + passing * unexplained) / (real + unexplained);
    const float ratio = fmin(fmax(passing + explained * (known - passing), 0.0f), clamp_at);
    const int usable = (real > black) & (real < 1e30f) & (fabs(both) < 1e30f) & (both != real);
    return usable ? ratio : 1.0f;
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
    const Sun disc,                        // -D SUN
    float clamp_at,                        // upper bound of the ratio: a larger one occurs in caustics, but also
                                           // where E_R is small and noisy, or the color too dark to be reliable
    int width,
    int height)
{
    TILE_LANES_ITEM;
    const int size = plane_size(width, height), start = plane_index(first, y, width), count = end - first;
    const float black = cache.black;
    float real[3][LANES], both[3][LANES];
#ifdef DELTA
    float blocked[3][LANES], bounce[3][LANES];
#ifdef NOISE
    const Filtered filtered = {signal, variance, guide, size, plane_stride(width)};
#endif
    float any = 0.0f;
    LANE_LOOP
    for (int i = 0; i < count; i++) {
        // Only filtered values are clamped: single samples may exceed the physical range.
        #pragma unroll
        for (int c = 0; c < 3; c++) {
            blocked[c][i] = fmin(fmax(signal[c * size + start + i], 0.0f), 1.0f);
            bounce[c][i] = fmax(signal[(c + 3) * size + start + i], 0.0f);
            real[c][i] = 0.0f;
        }
    }
#ifdef NOISE
    for (int i = 0; i < count; i++)
        if (load_stored_variance(variance, start + i) > NEGLIGIBLE) {
            const Change change = settled_change(filtered, start + i);
            const float3 less = clamp(change.blocked, 0.0f, 1.0f), more = fmax(change.bounce, 0.0f);
            blocked[0][i] = less.x, blocked[1][i] = less.y, blocked[2][i] = less.z;
            bounce[0][i] = more.x, bounce[1][i] = more.y, bounce[2][i] = more.z;
        }
#endif
    // For most pixels of most views, the change is too small for E_R to matter.
    float larger[LANES];
    LANE_LOOP
    for (int i = 0; i < count; i++) {
        const float red = fmax(blocked[0][i], bounce[0][i]), green = fmax(blocked[1][i], bounce[1][i]);
        const float most = fmax(red, fmax(green, fmax(blocked[2][i], bounce[2][i])));
        larger[i] = guide[GUIDE_ID * size + start + i] > 0.0f ? most : 0.0f;
    }
    for (int i = 0; i < count; i++)
        any = fmax(any, larger[i]);
    float weights[LANES];
    if (any >= SLIGHT) {
        LANE_LOOP
        for (int i = 0; i < count; i++) {
            const int p = start + i;
            const CellLight light = light_around(
                cache, 0, guide[GUIDE_POSITION * size + p], guide[(GUIDE_POSITION + 1) * size + p],
                guide[(GUIDE_POSITION + 2) * size + p], guide[p], guide[size + p], guide[2 * size + p]);
            weights[i] = light.weights;
            real[0][i] = light.r / light.weights;
            real[1][i] = light.g / light.weights;
            real[2][i] = light.b / light.weights;
        }
        for (int i = 0; i < count; i++)
            if (larger[i] >= SLIGHT && !(weights[i] > 0.0f)) {
                const float3 light = cached_irradiance(
                    cache, load_planes(guide + GUIDE_POSITION * size, size, start + i),
                    load_planes(guide + GUIDE_NORMAL * size, size, start + i));
                real[0][i] = light.x, real[1][i] = light.y, real[2][i] = light.z;
            }
    }
#ifdef SUN
    for (int i = 0; i < count; i++) {
        const int p = start + i;
        const float shown = luminance((float3)(color[p], color[size + p], color[2 * size + p]));
        const float others = luminance((float3)(real[0][i], real[1][i], real[2][i]));
        const float3 light = others > 0.0f && shows_sun(shown, others)
            ? sun_irradiance(disc, (float3)(guide[p], guide[size + p], guide[2 * size + p]))
            : (float3)(0.0f);
        real[0][i] += light.x, real[1][i] += light.y, real[2][i] += light.z;
    }
#endif
    LANE_LOOP
    for (int i = 0; i < count; i++) {
        #pragma unroll
        for (int c = 0; c < 3; c++) {
            real[c][i] = larger[i] >= SLIGHT ? real[c][i] : 0.0f;
            both[c][i] = real[c][i] * (1.0f - blocked[c][i] + bounce[c][i]);
        }
    }
#else
    LANE_LOOP
    for (int i = 0; i < count; i++) {
        #pragma unroll
        for (int c = 0; c < 3; c++) {
            real[c][i] = signal[c * size + start + i];
            both[c][i] = signal[(c + 3) * size + start + i];
        }
    }
#endif
    __global float *restrict out = (__global float *)(ratio + y * width + first);
    LANE_LOOP
    for (int i = 0; i < count; i++) {
        const int p = start + i;
        const float red = color[p], green = color[size + p], blue = color[2 * size + p];
        const float lit = luminance((float3)(real[0][i], real[1][i], real[2][i]));
        const float relit = luminance((float3)(both[0][i], both[1][i], both[2][i]));
        const float passing = fmin(fmax(relit / fmax(lit, black), 0.0f), 1.0f);
        const float of_red = explained_share(real[0][i], red, black);
        const float of_green = explained_share(real[1][i], green, black);
        const float of_blue = explained_share(real[2][i], blue, black);
        const float explained = fmin(fmax(fmin(of_red, fmin(of_green, of_blue)), 0.0f), 1.0f);
        float r = channel_ratio(real[0][i], both[0][i], red, passing, explained, black, clamp_at);
        float g = channel_ratio(real[1][i], both[1][i], green, passing, explained, black, clamp_at);
        float b = channel_ratio(real[2][i], both[2][i], blue, passing, explained, black, clamp_at);
#ifdef DELTA
        const int slight = larger[i] < SLIGHT;
        r = slight ? 1.0f - blocked[0][i] + bounce[0][i] : r;
        g = slight ? 1.0f - blocked[1][i] + bounce[1][i] : g;
        b = slight ? 1.0f - blocked[2][i] + bounce[2][i] : b;
#endif
        const int shown = guide[GUIDE_ID * size + p] > 0.0f;
        r = shown ? r : 1.0f;
        g = shown ? g : 1.0f;
        b = shown ? b : 1.0f;
        out[4 * i] = r;
        out[4 * i + 1] = g;
        out[4 * i + 2] = b;
        out[4 * i + 3] = 1.0f;
#ifdef DELTA
        const float most = fmax(fabs(r - 1.0f), fmax(fabs(g - 1.0f), fabs(b - 1.0f)));
        const float before = touched[p], raised = most > STRONG ? STRONG_FRAMES : TOUCHED_FRAMES;
        touched[p] = most > FAINT ? fmax(before, raised) : before;
#endif
    }
}
