// Temporal accumulation with motion vectors, and the variance of its result (moments after Schied et al.
// 2017, SVGF section 4.2; two histories, after NVIDIA's ReLAX; IPRT "Filtering").
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top.
//
//   kernel             in                                        out
//   accumulate         guide of this and the previous picture,   history at this picture's pixels
//                      motion (2 planes, previous position in    with the samples added: signal,
//                      pixels; -1e9 = nowhere), history,         length (effective number of
//                      samples, level; with -DCAMERA_MOTION      samples), spread (variance of
//                      camera.h, between the axes of the two     single samples of g); its scalar g;
//                      guides; with -DPUBLISHED the history is   variance of g's mean
//                      first clamped to the samples
//   follow             the same of a fast history                 the same
//   fetch              guides, motion, history                   history at this picture's pixels,
//                                                                without the samples; its g with the
//                                                                fast history
//   correct_real,      guide, both histories, g, samples, level  history corrected by and clamped to
//   correct_reflected                                            the fast one, with the samples
//                                                                added; its g; variance of g's mean
//   estimate_variance  guide, g, length                          variance of g's mean where histories
//                                                                are short, by neighbours
//
// g is the displayed scalar (filter/signal.h): for real surfaces the luminance of the first three planes
// minus the last three, else the signal's. Without correction, fading and motion, the accumulated signal is
// the plain mean of the samples. Non-finite samples are dropped. Where all samples are 0, the result is 0.
// Where their first three planes equal the last three, so do the result's, bit for bit.
#include "filter/history.h"

#define SPATIAL_TAPS 4        // along a side: every other pixel of a 7x7 neighbourhood
#define UNSURE 8.0f           // few samples of rare events underestimate the variance: 1 + 8 / n

// Write the variance of the mean of g; 0 where estimate_variance replaces it.
static inline ALWAYS_INLINE void store_variance(
    const History *history, PLANES_OUT certainty, int p, int x, int width, int seam)
{
    const float samples = history->length;
    const float own = (1.0f + UNSURE / samples) * history->spread / (samples - 1.0f);
    store_wrapped(certainty, p, x, width, seam, is_short(samples) ? 0.0f : own);
}

__kernel void accumulate(
    PLANES_IN guide[MOST_ENTRIES],               // 7 planes
    PLANES_IN guide_previous[MOST_ENTRIES],      // the same of the previous picture
    PLANES_IN motion[MOST_ENTRIES],              // 2 planes
    PLANES_IN signal_before[MOST_ENTRIES],       // the history's planes
    PLANES_IN certainty_before[MOST_ENTRIES],    // 2 planes
    const float plane_tolerance,                 // plane distance / depth within one surface
    const float normal_agreement,                // least cosine between its normals
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    PLANES_IN samples[MOST_ENTRIES],             // its planes; -DPUBLISHED: border too
    __global const uchar *restrict level[MOST_ENTRIES], // 1 plane: tracing density of this picture
    PLANES_OUT signal[MOST_ENTRIES],             // out: its planes and two more
    PLANES_OUT certainty[MOST_ENTRIES],          // out: 2 planes
    float clamp_sigma,                             // -DPUBLISHED: half width of the box in deviations
    float fading,                                  // least share of the new sample, 0: plain mean
    const float outlier[MOST_ENTRIES],             // most times the brightest neighbour, 0: no limit
    int rays,                                      // per sample, for short histories (rays.h)
    int width,
    int height,
    int seam,
    int planes,
    const Camera camera)
{
    TILE_ITEM;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    const float scale = outlier_factor(planes, samples, guide, outlier, size, p, width);
    History history = fetch_history(planes, guide, guide_previous, motion, signal_before, certainty_before,
                                    plane_tolerance, normal_agreement, SLEPT, p, width, height, seam, camera);
#ifdef PUBLISHED
    // The published mean is one of frames, whose lengths are not lowered.
    const float before = history.length;
    const Box box = nearby_box(planes, guide, samples, clamp_sigma, size, p, width);
    clamp_history(planes, &history, &box);
    history.length = before;
#endif
    add_sample(planes, &history, samples, guide, level, fading, scale, rays, size, p);
    store_history(planes, &history, signal, certainty, size, p, x, width, seam);
    store_variance(&history, certainty, p, x, width, seam);
}

__kernel void follow(
    PLANES_IN guide[MOST_ENTRIES],               // 7 planes
    PLANES_IN guide_previous[MOST_ENTRIES],      // the same of the previous picture
    PLANES_IN motion[MOST_ENTRIES],              // 2 planes
    PLANES_IN signal_before[MOST_ENTRIES],       // the history's planes
    PLANES_IN certainty_before[MOST_ENTRIES],    // 2 planes
    const float plane_tolerance,                 // plane distance / depth within one surface
    const float normal_agreement,                // least cosine between its normals
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    PLANES_IN samples[MOST_ENTRIES],             // its planes
    __global const uchar *restrict level[MOST_ENTRIES], // 1 plane: tracing density of this picture
    PLANES_OUT signal[MOST_ENTRIES],             // out: its planes and two more
    PLANES_OUT certainty[MOST_ENTRIES],          // out: 2 planes
    float limit,                                   // most samples of the history
    int fresh,                                     // the history starts with this picture
    int width,
    int height,
    int seam,
    int planes,
    const Camera camera)
{
    TILE_ITEM;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    History history = fetch_history(planes, guide, guide_previous, motion, signal_before, certainty_before,
                                    plane_tolerance, normal_agreement, 0.0f, p, width, height, seam, camera);
    if (fresh) {
        EACH_PLANE(c, planes)
            history.signal[c] = 0.0f;
        history.length = history.spread = 0.0f;
    }
    add_fast_sample(planes, &history, samples, guide, level, limit, size, p);
    store_history(planes, &history, signal, certainty, size, p, x, width, seam);
}

__kernel void fetch(
    PLANES_IN guide[MOST_ENTRIES],               // 7 planes
    PLANES_IN guide_previous[MOST_ENTRIES],      // the same of the previous picture
    PLANES_IN motion[MOST_ENTRIES],              // 2 planes
    PLANES_IN signal_before[MOST_ENTRIES],       // the history's planes
    PLANES_IN certainty_before[MOST_ENTRIES],    // 2 planes
    const float plane_tolerance,                 // plane distance / depth within one surface
    const float normal_agreement,                // least cosine between its normals
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    PLANES_OUT signal[MOST_ENTRIES],             // out: its planes and two more
    PLANES_OUT certainty[MOST_ENTRIES],          // out: 2 planes
    PLANES_OUT fast_signal[MOST_ENTRIES],        // out: g, replacing the fast history's own
    int width,
    int height,
    int seam,
    int planes,
    const Camera camera)
{
    TILE_ITEM;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    History history = fetch_history(planes, guide, guide_previous, motion, signal_before, certainty_before,
                                    plane_tolerance, normal_agreement, 0.0f, p, width, height, seam, camera);
    store_history(planes, &history, signal, certainty, size, p, x, width, seam);
    store_scalar(planes, history.signal, fast_signal, size, p, x, width, seam);
}

static inline ALWAYS_INLINE void correct_pixel(
    int planes, PLANES_IN guide, PLANES_IN fast_signal, PLANES_IN fast_certainty, PLANES_IN samples,
    __global const uchar *restrict level, PLANES_OUT signal, PLANES_OUT certainty, int x, int y,
    float antilag_sigma, float clamp_sigma, int trusted, float fading, float outlier, int rays, int width,
    int height, int seam)
{
    int size = plane_size(width, height), p = plane_index(x, y, width);
    const float scale = outlier_factor(planes, samples, guide, outlier, size, p, width);
    History history;
    if (trusted) {
        const float spread = signal[(planes + SPREAD_PLANE) * size + p];
        const float share = stale_share(planes, guide, fast_signal, fast_certainty,
                                        certainty[LENGTH_PLANE * size + p], spread,
                                        antilag_sigma, size, p, width);
        const Box box = nearby_box(planes, guide, fast_signal, clamp_sigma, size, p, width);
        history = load_history(planes, signal, certainty, size, p); // loaded late: it takes registers
        correct_history(planes, &history, fast_signal, fast_certainty, share, size, p);
        clamp_history(planes, &history, &box);
    } else {
        history = load_history(planes, signal, certainty, size, p);
    }
    add_sample(planes, &history, samples, guide, level, fading, scale, rays, size, p);
    store_history(planes, &history, signal, certainty, size, p, x, width, seam);
    store_variance(&history, certainty, p, x, width, seam);
}

// One kernel per kind: PoCL does not vectorize loops over a number of planes known only at run time.
__kernel void correct_real(
    PLANES_IN guide[1],          // 7 planes
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    PLANES_IN fast_signal[1],    // the fast history, with g of the slow one, borders wrapped
    PLANES_IN fast_certainty[1],
    PLANES_IN samples[1],        // the signal's planes
    __global const uchar *restrict level[1], // 1 plane: tracing density of this picture
    PLANES_OUT signal[1],        // in, out: the slow history
    PLANES_OUT certainty[1],
    float antilag_sigma,           // differences below this number of deviations are noise
    float clamp_sigma,             // half width of the box in deviations
    int trusted,                   // the fast history holds enough to compare with
    float fading,                  // least share of the new sample, 0: plain mean
    int rays,                      // of a sample, before they become fewer (rays.h)
    int width,
    int height,
    int seam)
{
    TILE_ITEM;
    correct_pixel(REAL_PLANES, guide, fast_signal, fast_certainty, samples, level, signal, certainty, x, y,
                  antilag_sigma, clamp_sigma, trusted, fading, 0.0f, rays, width, height, seam);
}

__kernel void correct_reflected(
    PLANES_IN guide[MOST_ENTRIES],               // 7 planes
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    PLANES_IN fast_signal[MOST_ENTRIES],         // the fast history, with g of the slow one, borders wrapped
    PLANES_IN fast_certainty[MOST_ENTRIES],
    PLANES_IN samples[MOST_ENTRIES],             // the signal's planes
    __global const uchar *restrict level[MOST_ENTRIES], // 1 plane: tracing density of this picture
    PLANES_OUT signal[MOST_ENTRIES],             // in, out: the slow history
    PLANES_OUT certainty[MOST_ENTRIES],
    float antilag_sigma,           // differences below this number of deviations are noise
    float clamp_sigma,             // half width of the box in deviations
    int trusted,                   // the fast history holds enough to compare with
    float fading,                  // least share of the new sample, 0: plain mean
    const float outlier[MOST_ENTRIES], // most times the brightest neighbour, 0: no limit
    int rays,                      // of a sample, before they become fewer (rays.h)
    int width,
    int height,
    int seam)
{
    TILE_ITEM;
    correct_pixel(REFLECTED_PLANES, guide, fast_signal, fast_certainty, samples, level, signal, certainty, x,
                  y, antilag_sigma, clamp_sigma, trusted, fading, outlier, rays, width, height, seam);
}

__kernel void estimate_variance(
    PLANES_IN guide[MOST_ENTRIES],               // 7 planes
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    PLANES_IN signal[MOST_ENTRIES],              // its planes and two more, border wrapped
    PLANES_OUT certainty[MOST_ENTRIES],          // in, out: 2 planes
    int width,
    int height,
    int seam,
    int planes)
{
    TILE_ITEM;
    int stride = plane_stride(width), size = plane_size(width, height), p = plane_index(x, y, width);
    PLANES_IN ids = guide + GUIDE_ID * size;
    PLANES_IN scalar = signal + (planes + SCALAR_PLANE) * size;
    const float samples = certainty[LENGTH_PLANE * size + p];
    if (!is_short(samples))
        return;
    float result = 0.0f;
    if (ids[p] > 0.0f) {
        float id = ids[p], centre = scalar[p], count = 1.0f, sum = 0.0f, square = 0.0f;
        for (int i = 0; i < SPATIAL_TAPS * SPATIAL_TAPS; i++) {
            int dx = 2 * (i % SPATIAL_TAPS) + 1 - SPATIAL_TAPS;
            int dy = 2 * (i / SPATIAL_TAPS) + 1 - SPATIAL_TAPS;
            int q = p + dx + dy * stride;
            float same = ids[q] == id ? 1.0f : 0.0f, d = same * (scalar[q] - centre);
            count += same;
            sum += d;
            square += d * d;
        }
        // Variance of the surrounding means as after SHORT_HISTORY samples, scaled up to a mean of fewer
        // samples.
        float boost = (SHORT_HISTORY + UNSURE) / fmax(samples, 1.0f);
        result = boost * fmax(square / count - sum * sum / (count * count), 0.0f);
    }
    store_wrapped(certainty, p, x, width, seam, result);
}
