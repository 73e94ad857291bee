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
//                      camera.h, between the axes of the two     single samples of g); its scalar g
//                      guides; with -DPUBLISHED the history is
//                      first clamped to the samples
//   follow             the same of a fast history                 the same
//   fetch              guides, motion, history                   history at this picture's pixels,
//                                                                without the samples; its g with the
//                                                                fast history
//   correct_real,      guide, both histories, g, samples, level  history corrected by and clamped to
//   correct_reflected                                            the fast one, with the samples
//                                                                added; its g
//   estimate_variance  guide, g, spread, length                  variance of g's mean
//
// g is the displayed scalar (filter/signal.h): for real surfaces the luminance of the first three planes
// minus the last three, else the signal's. Without correction, fading and motion, the accumulated signal is
// the plain mean of the samples. Non-finite samples are dropped. Where all samples are 0, the result is 0.
// Where their first three planes equal the last three, so do the result's, bit for bit.
#include "filter/history.h"

#define SPATIAL_TAPS 4        // along a side: every other pixel of a 7x7 neighbourhood
#define SHORT_HISTORY 4.0f    // fewer samples of one pixel do not determine their variance
#define UNSURE 8.0f           // few samples of rare events underestimate the variance: 1 + 8 / n

__kernel void accumulate(
    FETCH_BATCHED,
    SPAN_PARAMETERS,                             // where there are surfaces
    BATCHED(PLANES_IN, samples),                 // its planes; -DPUBLISHED: border too
    BATCHED(__global const uchar *restrict, level), // 1 plane: tracing density of this picture
    BATCHED(PLANES_OUT, signal),                 // out: its planes and two more
    BATCHED(PLANES_OUT, length),                 // out: 1 plane
#ifdef PUBLISHED
    float clamp_sigma,                             // half width of the box in deviations
#endif
    float fading,                                  // least share of the new sample, 0: plain mean
    int rays,                                      // per sample, for short histories (rays.h)
    int width,
    int height,
    int seam,
    int planes CAMERA_PARAMETER)
{
    SPAN_ITEM;
    PLANES_IN guide = OF_BATCH(guide);
    PLANES_IN samples = OF_BATCH(samples);
    int size = plane_size(width, height), p = plane_index(x, y, width);
    History history = fetch_history(planes, FETCH_ENTRIES, p, width, height, seam CAMERA_ARGUMENT);
#ifdef PUBLISHED
    // The published mean is one of frames, whose lengths are not lowered.
    const float before = history.length;
    const Box box = nearby_box(planes, guide, samples, clamp_sigma, size, p, width);
    clamp_history(planes, &history, &box);
    history.length = before;
#endif
    add_sample(planes, &history, samples, guide, OF_BATCH(level), fading, rays, size, p);
    store_history(planes, &history, OF_BATCH(signal), OF_BATCH(length), size, p, x, width, seam);
}

__kernel void follow(
    FETCH_BATCHED,                               // of the fast history
    SPAN_PARAMETERS,                             // where there are surfaces
    BATCHED(PLANES_IN, samples),                 // its planes
    BATCHED(__global const uchar *restrict, level), // 1 plane: tracing density of this picture
    BATCHED(PLANES_OUT, signal),                 // out: its planes and two more
    BATCHED(PLANES_OUT, length),                 // out: 1 plane
    float limit,                                   // most samples of the history
    int fresh,                                     // the history starts with this picture
    int width,
    int height,
    int seam,
    int planes CAMERA_PARAMETER)
{
    SPAN_ITEM;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    History history = fetch_history(planes, FETCH_ENTRIES, p, width, height, seam CAMERA_ARGUMENT);
    if (fresh) {
        EACH_PLANE(c, planes)
            history.signal[c] = 0.0f;
        history.length = history.spread = 0.0f;
    }
    add_fast_sample(planes, &history, OF_BATCH(samples), OF_BATCH(guide), OF_BATCH(level), limit, size, p);
    store_history(planes, &history, OF_BATCH(signal), OF_BATCH(length), size, p, x, width, seam);
}

__kernel void fetch(
    FETCH_BATCHED,
    SPAN_PARAMETERS,                             // where there are surfaces
    BATCHED(PLANES_OUT, signal),                 // out: its planes and two more
    BATCHED(PLANES_OUT, length),                 // out: 1 plane
    BATCHED(PLANES_OUT, fast_signal),            // out: g, replacing the fast history's own
    int width,
    int height,
    int seam,
    int planes CAMERA_PARAMETER)
{
    SPAN_ITEM;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    History history = fetch_history(planes, FETCH_ENTRIES, p, width, height, seam CAMERA_ARGUMENT);
    store_history(planes, &history, OF_BATCH(signal), OF_BATCH(length), size, p, x, width, seam);
    store_scalar(planes, history.signal, OF_BATCH(fast_signal), size, p, x, width, seam);
}

// Inputs of the correction of either kind of signal: guide, 7 planes; spans, where there are surfaces; the
// fast history, with g of the slow one, borders wrapped; samples, the signal's planes; level, the tracing
// density of this picture. In and out: the slow history.
#define CORRECT_BUFFERS(EACH)                                                                      \
    EACH(PLANES_IN, guide), SPAN_PARAMETERS, EACH(PLANES_IN, fast_signal),                         \
        EACH(PLANES_IN, fast_length), EACH(PLANES_IN, samples),                                    \
        EACH(__global const uchar *restrict, level), EACH(PLANES_OUT, signal),                     \
        EACH(PLANES_OUT, length)
#define CORRECT_ENTRY(OF)                                                                          \
    OF(guide), OF(fast_signal), OF(fast_length), OF(samples), OF(level), OF(signal), OF(length)
#define CORRECT_SCALARS                                                                            \
    float antilag_sigma, /* differences of so many deviations are noise */                         \
        float clamp_sigma, /* half width of the box in deviations */                               \
        int trusted, /* the fast history holds enough to compare with */                           \
        float fading, /* least share of the new sample, 0: plain mean */                           \
        int rays, /* of a sample, before they become fewer (rays.h) */                             \
        int width, int height, int seam

static inline ALWAYS_INLINE void correct_pixel(
    int planes, PLANES_IN guide, PLANES_IN fast_signal, PLANES_IN fast_length, PLANES_IN samples,
    __global const uchar *restrict level, PLANES_OUT signal, PLANES_OUT length, int x, int y,
    CORRECT_SCALARS)
{
    int size = plane_size(width, height), p = plane_index(x, y, width);
    History history;
    if (trusted) {
        const float spread = signal[(planes + SPREAD_PLANE) * size + p];
        const float share = stale_share(planes, guide, fast_signal, fast_length, length[p], spread,
                                        antilag_sigma, size, p, width);
        const Box box = nearby_box(planes, guide, fast_signal, clamp_sigma, size, p, width);
        history = load_history(planes, signal, length, size, p); // loaded late: it takes registers
        correct_history(planes, &history, fast_signal, fast_length, share, size, p);
        clamp_history(planes, &history, &box);
    } else {
        history = load_history(planes, signal, length, size, p);
    }
    add_sample(planes, &history, samples, guide, level, fading, rays, size, p);
    store_history(planes, &history, signal, length, size, p, x, width, seam);
}

// One kernel per kind: PoCL does not vectorize loops over a number of planes known only at run time.
__kernel void correct_real(CORRECT_BUFFERS(SINGLE), CORRECT_SCALARS)
{
    SPAN_ITEM;
    correct_pixel(REAL_PLANES, CORRECT_ENTRY(OF_SINGLE), x, y, antilag_sigma, clamp_sigma, trusted, fading, rays,
                  width, height, seam);
}

__kernel void correct_reflected(CORRECT_BUFFERS(BATCHED), CORRECT_SCALARS)
{
    SPAN_ITEM;
    correct_pixel(REFLECTED_PLANES, CORRECT_ENTRY(OF_BATCH), x, y, antilag_sigma, clamp_sigma, trusted, fading,
                  rays, width, height, seam);
}

__kernel void estimate_variance(
    BATCHED(PLANES_IN, guide),                   // 7 planes
    SPAN_PARAMETERS,                             // where there are surfaces
    BATCHED(PLANES_IN, signal),                  // its planes and two more, border wrapped
    BATCHED(PLANES_IN, length),                  // 1 plane
    BATCHED(PLANES_OUT, variance),               // out: 1 plane, of the scalar's mean
    int width,
    int height,
    int seam,
    int planes)
{
    SPAN_ITEM;
    PLANES_IN guide = OF_BATCH(guide);
    PLANES_IN length = OF_BATCH(length);
    PLANES_OUT variance = OF_BATCH(variance);
    int stride = plane_stride(width), size = plane_size(width, height), p = plane_index(x, y, width);
    PLANES_IN ids = guide + GUIDE_ID * size;
    PLANES_IN spread = OF_BATCH(signal) + (planes + SPREAD_PLANE) * size;
    PLANES_IN scalar = OF_BATCH(signal) + (planes + SCALAR_PLANE) * size;
    float samples = length[p], result = 0.0f;
    if (samples >= SHORT_HISTORY - 0.5f) { // the mean of four lengths of 4 may be rounded down
        result = (1.0f + UNSURE / samples) * spread[p] / (samples - 1.0f);
    } else if (ids[p] > 0.0f) {
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
    store_wrapped(variance, p, x, width, seam, result);
}
