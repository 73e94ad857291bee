// The history of a pixel: reprojection from the previous picture, correction, clamping and accumulation
// (filter/temporal.cl, which names the sources).
//
// -DCOMMON: filter/signal.h; -DCAMERA_MOTION: filter/surface.h.
#pragma once

#include "gbuffer/batch.h"
#include "trace/rays.h"
#include "filter/signal.h"
#include "filter/surface.h"

#define HUGE 1e30f            // samples from here on, and NaN, are not used
#define MAX_LENGTH 1e6f
// Samples without influence in the history of a pixel that wakes. Its first sample alone would flash. Pixels
// that wake because of a change have none (fetch). E_R (-DCOMMON) is unknown where pixels sleep.
#ifdef COMMON
#define SLEPT 0.0f
#else
#define SLEPT 8.0f
#endif
#define LEAST_NEIGHBOURS 3.0f // that determine whether a sample is an outlier
#define NEAR_STEP 2           // spacing of nine pixels that stand for a 5x5 neighbourhood

static inline ALWAYS_INLINE void load_signal(
    int planes, float *s, __global const float *signal, int size, int p)
{
    EACH_PLANE(c, planes)
        s[c] = signal[c * size + p];
}

// Transform a signal for clamping: with -DCOMMON the last three planes become their differences from the
// first three, with which they share their noise.
static inline void without_common(float *s)
{
#ifdef COMMON
    #pragma unroll
    for (int c = REFLECTED_PLANES; c < REAL_PLANES; c++)
        s[c] -= s[c - REFLECTED_PLANES];
#endif
}

static inline ALWAYS_INLINE bool all_finite(int planes, const float *s)
{
    float total = 0.0f;
    EACH_PLANE(c, planes)
        total += fabs(s[c]);
    return total < HUGE;
}

// Return the factor that reduces the sample of pixel p to at most `outlier` times the brightest of its neighbours.
// 0: no limit. The factor is computed before the history is loaded, because both take registers.
static inline ALWAYS_INLINE float outlier_factor(
    int planes, __global const float *samples, __global const float *guide, float outlier, int size, int p, int width)
{
    if (planes != REFLECTED_PLANES || !(outlier > 0.0f))
        return 1.0f;
    const float id = guide[GUIDE_ID * size + p];
    float own = 0.0f, most = 0.0f, count = 0.0f;
    #pragma unroll 1
    for (int i = 0; i < 9; i++) {
        const int q = p + i % 3 - 1 + (i / 3 - 1) * plane_stride(width);
        const float g = luminance(load_planes(samples, size, q));
        const int same = i != 4 && guide[GUIDE_ID * size + q] == id && g < HUGE;
        own = i == 4 ? g : own;
        count += same;
        most = same ? fmax(most, g) : most;
    }
    return count >= LEAST_NEIGHBOURS && own > outlier * most ? outlier * most / own : 1.0f;
}

// Load the sample of pixel p, times `scale`. Returns its weight in rays, 0 for an unusable sample. Pixels that share one
// ray have a fraction of its weight, so that a lone hit spread over many of them gives way to later rays of
// their own. A pixel that waits for its turn takes the values of others only as its `first` sample.
static inline ALWAYS_INLINE float load_sample(
    int planes, float *sample, __global const float *samples, __global const float *guide,
    __global const uchar *level, bool first, float scale, int size, int p)
{
    load_signal(planes, sample, samples, size, p);
    bool usable = guide[GUIDE_ID * size + p] > 0.0f && all_finite(planes, sample)
                  && (first || level[p] != LEVEL_WAITING);
    EACH_PLANE(c, planes)
        sample[c] *= scale;
    int spacing = level_spacing(usable ? level[p] : 0);
    return usable ? 1.0f / (spacing * spacing) : 0.0f;
}

// Return the effective number of samples of a history of `length` samples with variance `spread` and a
// given bias: the number with the same mean squared error.
static inline float worth_of_biased(float length, float spread, float bias_squared)
{
    float error = fmax(spread + length * bias_squared, 1e-30f);
    return bias_squared > 0.0f ? spread * length / error : length;
}

typedef struct {
    float signal[REAL_PLANES];
    float length;   // effective number of samples, 0: no history
    float spread;   // variance of single samples of g
} History;

static inline ALWAYS_INLINE History load_history(
    int planes, __global const float *signal, __global const float *certainty, int size, int p)
{
    History history;
    load_signal(planes, history.signal, signal, size, p);
    history.length = certainty[LENGTH_PLANE * size + p];
    history.spread = signal[(planes + SPREAD_PLANE) * size + p];
    return history;
}

static inline ALWAYS_INLINE void store_scalar(
    int planes, const float *s, __global float *signal, int size, int p, int x, int width, int seam)
{
    __global float *scalar = signal + (planes + SCALAR_PLANE) * size;
    store_wrapped(scalar, p, x, width, seam, guide_scalar(planes, s));
}

static inline ALWAYS_INLINE void store_history(
    int planes, const History *history, __global float *signal, __global float *certainty, int size, int p,
    int x, int width, int seam)
{
    EACH_PLANE(c, planes)
        store_wrapped(signal + c * size, p, x, width, seam, history->signal[c]);
    store_scalar(planes, history->signal, signal, size, p, x, width, seam);
    signal[(planes + SPREAD_PLANE) * size + p] = history->spread;
    certainty[LENGTH_PLANE * size + p] = history->length;
}

// Return the weights of four samples at -1, 0, 1 and 2 for a point between the second and the third (E. Catmull
// and R. Rom, "A Class of Local Interpolating Splines", 1974).
static inline ALWAYS_INLINE float4 spline_weights(float t)
{
    return (float4)(t * (-0.5f + t * (1.0f - 0.5f * t)), 1.0f + t * t * (-2.5f + 1.5f * t),
                    t * (0.5f + t * (2.0f - 1.5f * t)), t * t * (-0.5f + 0.5f * t));
}

// Replace the bilinear mean of a reflected signal at (mx, my) by a Catmull-Rom spline through 4x4 pixels, within
// the range of the four nearest. Blurred a little in every frame, the picture in a mirror would be soft while the
// head turns. Next to another surface the mean remains.
static inline ALWAYS_INLINE void sharpen_history(
    float *past, PLANES_IN guide_previous, PLANES_IN signal_before, PLANES_IN certainty_before, float id, float mx,
    float my, int size, int width, int height, int seam)
{
    const int left = (int)floor(mx) - 1, top = (int)floor(my) - 1;
    const float4 across = spline_weights(mx - floor(mx)), down = spline_weights(my - floor(my));
    float sum[REFLECTED_PLANES], low[REFLECTED_PLANES], high[REFLECTED_PLANES];
    #pragma unroll
    for (int c = 0; c < REFLECTED_PLANES; c++)
        sum[c] = 0.0f, low[c] = HUGE, high[c] = -HUGE;
    int whole = top >= 0 && top + 3 < height;
    #pragma unroll 1
    for (int i = 0; i < (whole ? 16 : 0); i++) {
        const int column = i & 3, row = i >> 2, x = wrap_column(left + column, width, seam);
        const int inside = x >= 0 && x < width, q = plane_index(inside ? x : 0, top + row, width);
        whole &= inside & (guide_previous[GUIDE_ID * size + q] == id)
            & (certainty_before[LENGTH_PLANE * size + q] > 0.0f);
        const float along = column < 2 ? (column ? across.y : across.x) : (column > 2 ? across.w : across.z);
        const float weight = along * (row < 2 ? (row ? down.y : down.x) : (row > 2 ? down.w : down.z));
        const int near = (column == 1 || column == 2) & (row == 1 || row == 2);
        #pragma unroll
        for (int c = 0; c < REFLECTED_PLANES; c++) {
            const float value = signal_before[c * size + q];
            sum[c] += weight * value;
            low[c] = near ? fmin(low[c], value) : low[c];
            high[c] = near ? fmax(high[c], value) : high[c];
        }
    }
    #pragma unroll
    for (int c = 0; c < REFLECTED_PLANES; c++)
        past[c] = whole ? clamp(sum[c], low[c], high[c]) : past[c];
}

// Return the history of the pixel's surface, where the previous picture showed it. Where the surface slept, its
// history is `slept` samples without influence.
static inline ALWAYS_INLINE History fetch_history(
    int planes, PLANES_IN guide, PLANES_IN guide_previous, PLANES_IN motion, PLANES_IN signal_before,
    PLANES_IN certainty_before, float plane_tolerance, float normal_agreement, float slept, int p, int width,
    int height, int seam, const Camera camera)
{
    int size = plane_size(width, height);
    const Surface surface = surface_before(guide, plane_tolerance, size, p, camera);

    float past[REAL_PLANES];
    EACH_PLANE(c, planes)
        past[c] = 0.0f;
    float weights = 0.0f, samples = 0.0f, variation = 0.0f;
    float mx = motion[p] - 0.5f, my = motion[size + p] - 0.5f;
    if (surface.id > 0.0f && fabs(mx) < 1e6f && fabs(my) < 1e6f) {
        int left = (int)floor(mx), top = (int)floor(my);
        float fx = mx - left, fy = my - top;
        #pragma unroll 1
        for (int i = 0; i < 4; i++) {
            int tx = wrap_column(left + (i & 1), width, seam), ty = top + (i >> 1);
            float w = ((i & 1) ? fx : 1.0f - fx) * ((i >> 1) ? fy : 1.0f - fy);
            if (!(w > 0.0f) || tx < 0 || tx >= width || ty < 0 || ty >= height)
                continue;
            int q = plane_index(tx, ty, width);
            if (slept > 0.0f && guide_previous[GUIDE_ID * size + q] == SLEEPING) {
                samples += w * slept;
                weights += w;
                continue;
            }
            if (!shows_surface(guide_previous, surface, normal_agreement, size, q)
                || !(certainty_before[LENGTH_PLANE * size + q] > 0.0f))
                continue;
            EACH_PLANE(c, planes)
                past[c] += w * signal_before[c * size + q];
            samples += w * certainty_before[LENGTH_PLANE * size + q];
            variation += w * signal_before[(planes + SPREAD_PLANE) * size + q];
            weights += w;
        }
    }
    if (planes == REFLECTED_PLANES && weights > 0.999f)
        sharpen_history(past, guide_previous, signal_before, certainty_before, surface.id, mx, my, size, width,
                        height, seam);
    // A single tap on the pixel centre has weight 1 and stays exact.
    bool found = weights > 0.01f;
    History history;
    EACH_PLANE(c, planes)
        history.signal[c] = found ? past[c] / weights : 0.0f;
    history.length = found ? samples / weights : 0.0f;
    history.spread = found ? variation / weights : 0.0f;
    return history;
}

// Return the share by which the slow history is stale (antilag). The means of the fast and the slow history
// over a neighbourhood may differ by more than noise explains. The excess is the bias of the slow one, of
// `before` samples of variance `spread`. It gives way to the fast one to the degree that this bias makes it
// the worse estimate. g of the slow history is stored with the fast one.
static inline ALWAYS_INLINE float stale_share(
    int planes, __global const float *restrict guide, __global const float *restrict fast,
    __global const float *restrict fast_certainty, float before,
    float spread, float sigma, int size, int p, int width)
{
    __global const float *restrict scalar = fast + (planes + SCALAR_PLANE) * size;
    float id = guide[GUIDE_ID * size + p];
    float count = 0.0f, sum = 0.0f, square = 0.0f;
    TAP_LOOP
    for (int i = 0; i < 9; i++) {
        int q = p + NEAR_STEP * (i % 3 - 1 + (i / 3 - 1) * plane_stride(width));
        float s[REAL_PLANES];
        load_signal(planes, s, fast, size, q);
        float same = guide[GUIDE_ID * size + q] == id ? 1.0f : 0.0f;
        float d = same * (guide_scalar(planes, s) - scalar[q]);
        count += same;
        sum += d;
        square += d * d;
    }
    float mean = sum / count;
    float variance = fmax(square / count - mean * mean, 0.0f) / fmax(count - 1.0f, 1.0f);
    float bias_squared = fmax(mean * mean - sigma * sigma * variance, 0.0f);
    float worth = worth_of_biased(before, spread, bias_squared);
    const float held = fast_certainty[LENGTH_PLANE * size + p];
    bool stale = id > 0.0f && before > 0.0f && held > 0.0f && worth < before;
    return stale ? 1.0f - worth / before : 0.0f;
}

static inline ALWAYS_INLINE void correct_history(
    int planes, History *history, __global const float *restrict fast,
    __global const float *restrict fast_certainty, float share, int size, int p)
{
    float before = history->length;
    EACH_PLANE(c, planes) {
        float past = history->signal[c];
        history->signal[c] = past + share * (fast[c * size + p] - past);
    }
    const float held = fast_certainty[LENGTH_PLANE * size + p];
    history->length = before + share * (fmin(held, before) - before);
}

// Mean +- sigma deviations of a neighbourhood, extended to the pixel's own value.
typedef struct {
    float low[REAL_PLANES];
    float high[REAL_PLANES];
    bool usable;
} Box;

static inline ALWAYS_INLINE Box nearby_box(
    int planes, __global const float *restrict guide, __global const float *restrict nearby, float sigma, int size,
    int p, int width)
{
    float id = guide[GUIDE_ID * size + p];
    float centre[REAL_PLANES], mean[REAL_PLANES], square[REAL_PLANES];
    load_signal(planes, centre, nearby, size, p);
    without_common(centre);
    Box box;
    box.usable = id > 0.0f && all_finite(planes, centre);
    EACH_PLANE(c, planes)
        mean[c] = square[c] = 0.0f;
    float count = 0.0f;
    TAP_LOOP
    for (int i = 0; i < 9; i++) {
        int q = p + NEAR_STEP * (i % 3 - 1 + (i / 3 - 1) * plane_stride(width));
        float s[REAL_PLANES];
        load_signal(planes, s, nearby, size, q);
        without_common(s);
        bool used = guide[GUIDE_ID * size + q] == id && all_finite(planes, s);
        count += used ? 1.0f : 0.0f;
        EACH_PLANE(c, planes) {
            // Relative to the centre, whose value may be large against the spread.
            float d = used ? s[c] - centre[c] : 0.0f;
            mean[c] += d;
            square[c] += d * d;
        }
    }
    float scale = 1.0f / fmax(count, 1.0f);
    EACH_PLANE(c, planes) {
        float m = scale * mean[c];
        float deviation = sigma * sqrt(fmax(scale * square[c] - m * m, 0.0f));
        box.low[c] = centre[c] + fmin(m - deviation, 0.0f);
        box.high[c] = centre[c] + fmax(m + deviation, 0.0f);
    }
    return box;
}

// Clamp the history to a box (IPRT "Filtering"). Where no object has influence, the box of the change by
// objects is a point, so an old shadow disappears at once. E_RV (-DCOMMON) is clamped by its difference to
// E_R, although E_R itself is noisy. The length is lowered where g moved.
static inline ALWAYS_INLINE void clamp_history(int planes, History *history, const Box *box)
{
    float value[REAL_PLANES], clamped[REAL_PLANES];
    EACH_PLANE(c, planes)
        value[c] = history->signal[c];
    without_common(value);
    bool moved = false;
    EACH_PLANE(c, planes) {
        clamped[c] = fmin(fmax(value[c], box->low[c]), box->high[c]);
        moved = moved || clamped[c] != value[c];
#ifdef COMMON
        clamped[c] += c < REFLECTED_PLANES ? 0.0f : clamped[c - REFLECTED_PLANES];
#endif
    }
    moved = moved && box->usable;
    float step = guide_scalar(planes, clamped) - guide_scalar(planes, history->signal);
    float worth = worth_of_biased(history->length, history->spread, step * step);
    history->length = moved ? worth : history->length;
    EACH_PLANE(c, planes)
        history->signal[c] = moved ? clamped[c] : history->signal[c];
}

// Add the sample of pixel p to the mean.
static inline ALWAYS_INLINE void add_sample(
    int planes, History *history, __global const float *samples, __global const float *guide,
    __global const uchar *level, float fading, float scale, int rays, int size, int p)
{
    float sample[REAL_PLANES], before = history->length, variation = history->spread;
    // A fading history counts frames, whatever their number of rays.
    float sent = fading > 0.0f ? 1.0f : share_of_rays(before, rays);
    bool first = !(before > 0.0f);
    float worth = sent * load_sample(planes, sample, samples, guide, level, first, scale, size, p);
    bool usable = worth > 0.0f;
    float share = first ? 1.0f : fmax(worth / (before + worth), fading * worth);
    // Fading limits the mean to the weight of (2 - fading) / fading samples, so that a later, longer
    // average continues with the right weight.
    float limit = fading > 0.0f ? fmin(2.0f / fading - 1.0f, MAX_LENGTH) : MAX_LENGTH;
    float step = guide_scalar(planes, sample) - guide_scalar(planes, history->signal);
    float varied = first ? 0.0f : (1.0f - share) * (variation + share * sent * step * step);
    EACH_PLANE(c, planes) {
        float past = history->signal[c];
        float mean = first ? sample[c] : past + share * (sample[c] - past);
        history->signal[c] = usable ? mean : past;
    }
    history->length = usable ? fmin(before + worth, limit) : before;
    history->spread = usable ? varied : variation;
}

// Add the sample to the fast history, which holds at most `limit` samples.
static inline ALWAYS_INLINE void add_fast_sample(
    int planes, History *history, __global const float *samples, __global const float *guide,
    __global const uchar *level, float limit, int size, int p)
{
    float sample[REAL_PLANES], before = history->length;
    float worth = load_sample(planes, sample, samples, guide, level, !(before > 0.0f), 1.0f, size, p);
    bool usable = worth > 0.0f;
    float share = before > 0.0f ? worth / fmin(before + worth, limit) : 1.0f;
    EACH_PLANE(c, planes) {
        float past = history->signal[c];
        float mean = share < 1.0f ? past + share * (sample[c] - past) : sample[c];
        history->signal[c] = usable ? mean : past;
    }
    history->length = usable ? fmin(before + worth, limit) : before;
}
