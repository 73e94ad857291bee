// One level of the edge-avoiding à-trous filter (IPRT "Filtering": 65x65 joint bilateral in five
// levels; Dammertz et al. 2010; variance guidance after Schied et al. 2017, SVGF Eqs. 2-5).
//
// All planes of a signal share one set of weights, so that E_R and E_RV are averaged over the
// same pixels before they are divided, and equal inputs give equal bits. The weight of a tap q is
//   h(q) * falloff(k_n (1 - n_p . n_q) + k_d |n_p . (x_q - x_p)| / |x_p|
//                   + (g_p - g_q)^2 / (k_v^2 (v_p + v_q) + NOISE_FLOOR^2)), 0 where ids differ,
// where h is the B3 spline or, of 3x3 taps, that of ReLAX, relative to the centre's, g the scalar that
// the picture shows (luminance of E_R - E_RV or of blocked - bounced light on real surfaces, of the
// signal on virtual ones) and v its variance. Both variances enter, so that a pixel which missed a rare
// event still takes part in what its noisy neighbours found. On real surfaces 1 - n_p . n_q is reduced by
// what it is for the adjacent pixel most like p (least_turn): bevelled edges a few pixels wide would have
// no pixels to be averaged with.
//
//   in    guide (7 planes, guide.h), signal (SIGNAL_PLANES), variance (1) of g, roughness (1, GGX
//         alpha; where specular), borders wrapped in equirect views
//   out   signal, variance: pixels without a surface are copied
//
// Between levels, signals and variances are planes of stored.h. With -DHALF_PLANES, the first level is
// built with -DFIRST and the last one with -DLAST: what comes in and what goes out are planes of float.
//
// Build with -DSIGNAL_PLANES=3|6, -DDIFFERENCE for a real layer (planes E_R rgb, E_RV rgb with
// -DCOMMON too, else blocked / E_R rgb, bounce / E_R rgb), -DSPECULAR=n where the first n signals
// of the -DBATCH are specular radiance, -DEXTENT for kernels that find where there is anything but 0,
// -DTAPS=3|5 in a row, and -DGUIDED, without which luminance does not count (IPRT's joint bilateral
// filter). Work groups of (n, 1) vectorize best on CPUs.
#include "gbuffer/batch.h"
#include "gbuffer/guide.h"
#include "gbuffer/stored.h"
#include "filter/signal.h"

#define MIRROR_ALPHA 1e-4f     // below: a perfect mirror, which is not filtered
#define NORMAL_SPREAD 1.0f     // alpha^2 per sum of squared normal steps to the four neighbours
// Differences up to this fraction of a pixel's luminance, or of the light that a real surface receives,
// count as noise always: a little more than what half precision rounds by.
#define NOISE_FLOOR 0.002f
#define MOST_TURN 0.3f         // 1 - cosine between normals that may still be of one surface

#if defined(DIFFERENCE) && defined(GUIDED)
#define BENT // with least_turn
#endif

#ifdef FIRST
#define SIGNAL_IN PLANES_IN
#define load_in(plane, p) (unit * (plane)[p])
#else
#define SIGNAL_IN STORED_IN
#define load_in(plane, p) load_stored(plane, p)
#endif
#ifdef LAST
#define SIGNAL_OUT PLANES_OUT
#define store_out(plane, p, x, width, seam, value)                                                 \
    store_wrapped(plane, p, x, width, seam, (value) / unit)
#else
#define SIGNAL_OUT STORED_OUT
#define store_out(plane, p, x, width, seam, value)                                                 \
    store_stored(plane, p, x, width, seam, value)
#endif

#ifdef EXTENT
// The columns of each row between which objects do anything, for all that is known.
__kernel void find_extent(
    __global const float *restrict signal,   // SIGNAL_PLANES planes
    __global const float *restrict variance, // of the guide scalar's mean
    __global int *restrict extent,           // out: per row first column and end; (width, 0): none
    int width,
    int height)
{
    int y = get_global_id(0);
    if (y >= height)
        return;
    int size = plane_size(width, height), first = width, end = 0;
    for (int x = 0; x < width; x++) {
        int p = plane_index(x, y, width);
        bool active = variance[p] > 0.0f;
        #pragma unroll
        for (int c = 0; c < SIGNAL_PLANES; c++)
            active = active || signal[c * size + p] != 0.0f;
        first = active ? min(first, x) : first;
        end = active ? x + 1 : end;
    }
    extent[2 * y] = first;
    extent[2 * y + 1] = end;
}

// The columns that the levels may change: those within their reach of active ones; and those that
// they changed in the previous picture, which go back to 0 unless they are still within reach.
__kernel void grow_extent(
    __global const int *restrict found,    // per row first column and end, of find_extent
    __global const int *restrict previous, // `grown` of the previous picture
    __global int *restrict grown,          // out: per row
    __global int *restrict extent,         // out: per row, what to filter: spans of filter_level
    int reach,                             // of all levels together
    int width,
    int height,
    int seam)
{
    int y = get_global_id(0);
    if (y >= height)
        return;
    int first = width, end = 0;
    for (int row = max(y - reach, 0); row <= min(y + reach, height - 1); row++) {
        first = min(first, found[2 * row]);
        end = max(end, found[2 * row + 1]);
    }
    bool any = first < end;
    bool everywhere = seam && any && (first < reach || end > width - reach); // across the seam
    first = !any ? width : everywhere ? 0 : max(first - reach, 0);
    end = !any ? 0 : everywhere ? width : min(end + reach, width);
    grown[2 * y] = first;
    grown[2 * y + 1] = end;
    bool before = previous[2 * y] < previous[2 * y + 1];
    extent[2 * y] = before ? min(first, previous[2 * y]) : first;
    extent[2 * y + 1] = before ? max(end, previous[2 * y + 1]) : end;
}
#endif

// Weight of a tap in a row over that of the middle one.
static inline float tap_weight(int d)
{
#if TAPS == 3
    return d == 0 ? 1.0f : 0.27901f / 0.44198f; // as in ReLAX
#else
    return d == 0 ? 1.0f : abs(d) == 1 ? 0.25f / 0.375f : 0.0625f / 0.375f; // B3 spline
#endif
}

__kernel void filter_level(
    BATCHED(PLANES_IN, guide),                   // 7 planes
    BATCHED(SIGNAL_IN, signal),                  // SIGNAL_PLANES planes
    BATCHED(STORED_IN, variance),                // of the guide scalar's mean
    BATCHED(SIGNAL_OUT, signal_out),             // SIGNAL_PLANES planes
    BATCHED(STORED_OUT, variance_out),           // 1 plane
    SPAN_PARAMETERS,                             // where there are surfaces; the rest is 0
#ifdef BENT
    BATCHED(STORED_IN, turned),                  // of smooth_variance
#endif
#if SPECULAR
    BATCHED(STORED_IN, roughness),               // of smooth_variance; < 1e-4: copied
    float lobe_fraction,                         // of the lobe's half width that taps may span
#endif
    int step,                                    // tap distance in pixels: 1, 2, 4, 8, 16
    float normal_sharpness,                      // k_n
    float plane_sharpness,                       // k_d
    float variance_scale,                        // k_v^2
#if defined(FIRST) || defined(LAST)
    float unit,                                  // of signals in half precision
#endif
    int width,
    int height,
    int seam)
{
    SPAN_ITEM;
    PLANES_IN guide = OF_BATCH(guide);
    SIGNAL_IN signal = OF_BATCH(signal);
    STORED_IN variance = OF_BATCH(variance);
    SIGNAL_OUT signal_out = OF_BATCH(signal_out);
    STORED_OUT variance_out = OF_BATCH(variance_out);
    int size = plane_size(width, height), stride = plane_stride(width);
    int p = plane_index(x, y, width);

    float nx = guide[p], ny = guide[size + p], nz = guide[2 * size + p];
    float px = guide[3 * size + p], py = guide[4 * size + p], pz = guide[5 * size + p];
    float id = guide[6 * size + p];
    float plane = nx * px + ny * py + nz * pz;
    float distance_squared = px * px + py * py + pz * pz;
    float plane_scale = plane_sharpness / sqrt(fmax(distance_squared, 1e-30f));

    float centre[SIGNAL_PLANES], sum[SIGNAL_PLANES];
    #pragma unroll
    for (int c = 0; c < SIGNAL_PLANES; c++) {
        centre[c] = load_in(signal, c * size + p);
        sum[c] = centre[c];
    }
    float weights = 1.0f;
    const float own = load_stored_variance(variance, p);
    float variances = own;
    float g = guide_scalar(centre);
#if defined(DIFFERENCE) && !defined(COMMON)
    float tolerance = NOISE_FLOOR; // the signal is a fraction of all light
#else
    float tolerance = NOISE_FLOOR * luminance((float3)(centre[0], centre[1], centre[2]));
#endif
    tolerance = variance_scale * own + tolerance * tolerance + 1e-30f;
    // No tap matches -2, so that a pixel without a surface keeps what it has.
    float same = id > 0.0f ? id : -2.0f;
#if SPECULAR
    // The lobe of half width 2 alpha turns by twice the normal's angle and by the view angle.
    const bool specular = entry < SPECULAR;
    const float alpha = load_stored(OF_BATCH(roughness), p);
    same = specular && alpha < MIRROR_ALPHA ? -2.0f : same;
    float span = 2.0f * lobe_fraction * fmax(alpha, MIRROR_ALPHA);
    float lobe = specular ? 0.5f / (span * span) : 0.0f;
    normal_sharpness = fmax(normal_sharpness, 8.0f * lobe);
    lobe /= fmax(distance_squared, 1e-30f);
#endif
#ifdef BENT
    const float turned = load_stored(OF_BATCH(turned), p);
#else
    const float turned = 0.0f;
#endif
    // Weights are relative to the centre's.
    TAP_LOOP
    for (int i = 0; i < TAPS_IF(same > 0.0f, TAPS * TAPS); i++) {
        const int dx = i % TAPS - TAPS / 2, dy = i / TAPS - TAPS / 2;
        if (dx == 0 && dy == 0)
            continue;
        int q = p + step * (dx + dy * stride);
        float turn = 1.0f - (nx * guide[q] + ny * guide[size + q] + nz * guide[2 * size + q]);
        float qx = guide[3 * size + q], qy = guide[4 * size + q], qz = guide[5 * size + q];
        float off_plane = nx * qx + ny * qy + nz * qz - plane;
        float tap[SIGNAL_PLANES];
        #pragma unroll
        for (int c = 0; c < SIGNAL_PLANES; c++)
            tap[c] = load_in(signal, c * size + q);
        float v = load_stored_variance(variance, q);
        float differ = normal_sharpness * fmax(turn - turned, 0.0f) + plane_scale * fabs(off_plane);
#ifdef GUIDED
        float dg = guide_scalar(tap) - g;
        differ += dg * dg / (variance_scale * v + tolerance);
#endif
#if SPECULAR
        float ax = qx - px, ay = qy - py, az = qz - pz;
        differ += lobe * (ax * ax + ay * ay + az * az);
#endif
        float near = tap_weight(dx) * tap_weight(dy);
        float w = guide[6 * size + q] == same ? near * falloff(differ) : 0.0f;
        #pragma unroll
        for (int c = 0; c < SIGNAL_PLANES; c++)
            sum[c] += w * tap[c];
        weights += w;
        variances += w * w * v;
    }
    // Where no tap counts this is 1, and the centre keeps its bits.
    float scale = 1.0f / weights;
    #pragma unroll
    for (int c = 0; c < SIGNAL_PLANES; c++)
        store_out(signal_out + c * size, p, x, width, seam, scale * sum[c]);
    store_stored_variance(variance_out, p, x, width, seam, scale * scale * variances);
}

#if SPECULAR
// GGX alpha of the lobe of a whole pixel: the normals within it turn its reflections too, by twice
// their angle, as alpha does (Kaplanyan et al. 2016; Tokuyoshi and Kaplanyan 2019, Eq. 1). Where
// surfaces bend within a pixel, one normal stands for many, and neighbours show what it misses.
static inline float widened_alpha(
    __global const float *restrict guide, float alpha, int size, int stride, int p)
{
    float turned = 0.0f;
    #pragma unroll
    for (int i = 0; i < 4; i++) {
        int q = p + (i < 2 ? 2 * i - 1 : (2 * i - 5) * stride);
        float dx = guide[q] - guide[p], dy = guide[size + q] - guide[size + p];
        float dz = guide[2 * size + q] - guide[2 * size + p];
        bool same = guide[GUIDE_ID * size + q] == guide[GUIDE_ID * size + p];
        turned += same ? dx * dx + dy * dy + dz * dz : 0.0f;
    }
    return alpha < MIRROR_ALPHA ? alpha : sqrt(alpha * alpha + NORMAL_SPREAD * turned);
}
#endif

#ifdef BENT
// 1 - cosine of the normal with the most like it of the eight neighbours'; 0 where none is like it.
static inline float least_turn(__global const float *restrict guide, int size, int stride, int p)
{
    float least = MOST_TURN;
    #pragma unroll
    for (int dy = -1; dy <= 1; dy++) {
        #pragma unroll
        for (int dx = -1; dx <= 1; dx++) {
            const int q = p + dx + dy * stride;
            const float turn = 1.0f - (guide[p] * guide[q] + guide[size + p] * guide[size + q]
                                       + guide[2 * size + p] * guide[2 * size + q]);
            const bool same = guide[GUIDE_ID * size + q] == guide[GUIDE_ID * size + p];
            least = (dx || dy) && same ? fmin(least, turn) : least;
        }
    }
    return least < MOST_TURN ? least : 0.0f;
}
#endif

// What the levels are given. 3x3 binomial mean of the variance over pixels of one id: single
// estimates are too noisy to steer the weights (Schied et al. 2017, section 4.4).
__kernel void smooth_variance(
    BATCHED(PLANES_IN, guide),                   // 7 planes
    BATCHED(PLANES_IN, variance),                // 1 plane
    BATCHED(STORED_OUT, smooth),                 // out: 1 plane
#ifdef BENT
    BATCHED(STORED_OUT, turned),                 // out: 1 plane
#endif
    SPAN_PARAMETERS,                             // where there are surfaces
#if SPECULAR
    BATCHED(PLANES_IN, roughness),               // GGX alpha
    BATCHED(STORED_OUT, widened),                // out: 1 plane; mirrors stay mirrors
#endif
#ifdef HALF_PLANES
    float unit,                                  // of signals in half precision
#endif
    int width,
    int height,
    int seam)
{
    SPAN_ITEM;
    PLANES_IN guide = OF_BATCH(guide);
    PLANES_IN variance = OF_BATCH(variance);
    STORED_OUT smooth = OF_BATCH(smooth);
    int stride = plane_stride(width), p = plane_index(x, y, width);
    __global const float *restrict id = guide + GUIDE_ID * plane_size(width, height);
    float sum = 0.0f, weights = 0.0f;
    #pragma unroll
    for (int dy = -1; dy <= 1; dy++) {
        #pragma unroll
        for (int dx = -1; dx <= 1; dx++) {
            int q = p + dx + dy * stride;
            float w = (float)((2 - abs(dx)) * (2 - abs(dy)));
            w = id[q] == id[p] ? w : 0.0f;
            sum += w * variance[q];
            weights += w;
        }
    }
#ifdef HALF_PLANES
    sum = sum * unit * unit; // the square alone may be beyond all floats
#endif
    store_stored_variance(smooth, p, x, width, seam, sum / weights);
#ifdef BENT
    store_stored(OF_BATCH(turned), p, x, width, seam,
                 least_turn(guide, plane_size(width, height), stride, p));
#endif
#if SPECULAR
    if (entry < SPECULAR)
        store_stored(OF_BATCH(widened), p, x, width, seam,
                     widened_alpha(guide, OF_BATCH(roughness)[p], plane_size(width, height),
                                   stride, p));
#endif
}
