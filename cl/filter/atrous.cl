// One level of the edge-avoiding à-trous filter (IPRT "Filtering": 65x65 joint bilateral in five levels;
// Dammertz et al. 2010; variance guidance after Schied et al. 2017, SVGF Eqs. 2-5).
//
// All planes of a signal share one set of weights. E_R and E_RV are thus averaged over the same pixels
// before they are divided, and equal inputs give equal bits. The weight of a tap q is
//   h(q) * falloff(k_n (1 - n_p . n_q) + k_d |n_p . (x_q - x_p)| / |x_p|
//                   + (g_p - g_q)^2 / (k_v^2 (v_p + v_q) + NOISE_FLOOR^2)), 0 where ids differ.
// h is the B3 spline or, for 3x3 taps, ReLAX's kernel, relative to the centre. g is the displayed scalar
// (luminance of E_R - E_RV or of blocked - bounced light on real surfaces, of the signal on virtual ones),
// and v its variance. Both variances enter, so that a pixel that missed a rare event still uses its noisy
// neighbours. On real surfaces, 1 - n_p . n_q is reduced by its value for the adjacent pixel most like p
// (least_turn): bevelled edges a few pixels wide would have no pixels to average with.
//
//   in    guide (7 planes, guide.h), signal (filter/signal.h), variance (1) of g, roughness (1, GGX
//         alpha; where specular), borders wrapped in equirect views
//   out   signal, variance: pixels without a surface are copied
//
// Between levels, signals and variances are planes of stored.h. With -DHALF_PLANES, the first level is
// built with -DFIRST and the last one with -DLAST: their input and output, respectively, are planes of
// float.
//
// Each step has two kernels: one for a single signal of real surfaces (6 planes), and one for batches of
// reflected signals (3), of which the first `specular` are specular radiance. Build with -DCOMMON as in
// filter/signal.h, and with -DGUIDED for variance guidance. Without it luminance does not count (IPRT's
// joint bilateral filter). Loops over taps enclose lane loops: unrolled inside of these, 25 taps are too much
// for PoCL to vectorize, and take four times as long.
#include "gbuffer/batch.h"
#include "gbuffer/guide.h"
#include "gbuffer/stored.h"
#include "filter/signal.h"
#include "maths/lanes.h"

#define MIRROR_ALPHA 1e-4f     // below: a perfect mirror, filtered only where it bends within a pixel
#define NORMAL_SPREAD 0.5f     // alpha^2 per sum of squared normal steps to the four neighbours
// Relative differences of luminance, or fractions of the light on a real surface, that always count as
// noise: a little more than the rounding error of half precision.
#define NOISE_FLOOR 0.002f
#define MOST_TURN 0.3f         // 1 - cosine between normals within one surface

// Taps in a row: ReLAX's where a variance guides signals of real surfaces, else the B3 spline's.
#define RELAX_TAPS 3
#define SPLINE_TAPS 5
#ifdef GUIDED
#define REAL_TAPS RELAX_TAPS
#else
#define REAL_TAPS SPLINE_TAPS
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
#define store_out(plane, p, value) (plane)[p] = (value) / unit
#define wrap_out wrap_row
#else
#define SIGNAL_OUT STORED_OUT
#define store_out store_stored
#define wrap_out wrap_stored
#endif

// Return the weight of a tap in a row over the middle one's.
static inline ALWAYS_INLINE float tap_weight(int taps, int d)
{
    if (taps == RELAX_TAPS)
        return d == 0 ? 1.0f : 0.27901f / 0.44198f;
    return d == 0 ? 1.0f : abs(d) == 1 ? 0.25f / 0.375f : 0.0625f / 0.375f;
}

// Filter the pixels of a row from column `first` to `end`. `planes` and `taps` are constants. `lobes`: GGX
// roughness of `specular` signals, whose mirrors are copied; `turned`: from smooth_real, or null.
static inline ALWAYS_INLINE void filter_row(
    int planes, int taps, int specular, STORED_IN lobes, float lobe_fraction, STORED_IN turned,
    PLANES_IN guide, SIGNAL_IN signal, STORED_IN variance, SIGNAL_OUT signal_out,
    STORED_OUT variance_out, int first, int end, int y, int step, float normal_sharpness,
    float plane_sharpness, float variance_scale, float unit, int width, int height)
{
    const int size = plane_size(width, height), stride = plane_stride(width);
    const int start = plane_index(first, y, width);
    float sum[REAL_PLANES][LANES], weights[LANES], variances[LANES];
    float same[LANES], plane[LANES], plane_scale[LANES], g[LANES], tolerance[LANES];
    float turn_scale[LANES], lobe[LANES], least[LANES];
    LANE_LOOP
    for (int i = 0; i < LANES; i++) {
        const int p = start + i;
        const float px = guide[3 * size + p], py = guide[4 * size + p], pz = guide[5 * size + p];
        const float distance_squared = fmax(px * px + py * py + pz * pz, 1e-30f);
        plane[i] = guide[p] * px + guide[size + p] * py + guide[2 * size + p] * pz;
        plane_scale[i] = plane_sharpness / sqrt(distance_squared);
        float centre[REAL_PLANES];
        EACH_PLANE(c, planes) {
            centre[c] = load_in(signal, c * size + p);
            sum[c][i] = centre[c];
        }
        weights[i] = 1.0f;
        variances[i] = load_stored_variance(variance, p);
        g[i] = guide_scalar(planes, centre);
#ifdef COMMON
        const int relative = 0;
#else
        const int relative = planes == REAL_PLANES; // the signal is a fraction of all light
#endif
        const float brightness = luminance((float3)(centre[0], centre[1], centre[2]));
        const float floor = relative ? NOISE_FLOOR : NOISE_FLOOR * brightness;
        tolerance[i] = variance_scale * variances[i] + floor * floor + 1e-30f;
        // No tap matches -2, so that a pixel without a surface is unchanged.
        const float id = guide[GUIDE_ID * size + p];
        same[i] = id > 0.0f ? id : -2.0f;
        least[i] = turned ? load_stored(turned, p) : 0.0f;
        turn_scale[i] = normal_sharpness;
        lobe[i] = 0.0f;
        if (planes == REFLECTED_PLANES) {
            // The lobe of half width 2 alpha turns by twice the normal's angle and by the view angle.
            const float alpha = load_stored(lobes, p);
            same[i] = specular & (alpha < MIRROR_ALPHA) ? -2.0f : same[i];
            const float span = 2.0f * lobe_fraction * fmax(alpha, MIRROR_ALPHA);
            const float narrow = specular ? 0.5f / (span * span) : 0.0f;
            turn_scale[i] = fmax(normal_sharpness, 8.0f * narrow);
            lobe[i] = narrow / distance_squared;
        }
    }
    float any = 0.0f;
    for (int i = 0; i < LANES; i++)
        any = fmax(any, same[i]);
    // Weights are relative to the centre's.
    #pragma unroll 1
    for (int tap = 0; tap < (any > 0.0f ? taps * taps : 0); tap++) {
        const int dx = tap % taps - taps / 2, dy = tap / taps - taps / 2;
        if (dx == 0 && dy == 0)
            continue;
        const float near = tap_weight(taps, dx) * tap_weight(taps, dy);
        const int there = start + step * (dx + dy * stride);
        LANE_LOOP
        for (int i = 0; i < LANES; i++) {
            const int p = start + i, q = there + i;
            const float nx = guide[p], ny = guide[size + p], nz = guide[2 * size + p];
            const float turn = 1.0f - (nx * guide[q] + ny * guide[size + q] + nz * guide[2 * size + q]);
            const float qx = guide[3 * size + q], qy = guide[4 * size + q], qz = guide[5 * size + q];
            const float off_plane = nx * qx + ny * qy + nz * qz - plane[i];
            float value[REAL_PLANES];
            EACH_PLANE(c, planes)
                value[c] = load_in(signal, c * size + q);
            const float v = load_stored_variance(variance, q);
            float differ
                = turn_scale[i] * fmax(turn - least[i], 0.0f) + plane_scale[i] * fabs(off_plane);
#ifdef GUIDED
            const float dg = guide_scalar(planes, value) - g[i];
            differ += dg * dg / (variance_scale * v + tolerance[i]);
#endif
            if (planes == REFLECTED_PLANES) {
                const float ax = qx - guide[3 * size + p], ay = qy - guide[4 * size + p];
                const float az = qz - guide[5 * size + p];
                differ += lobe[i] * (ax * ax + ay * ay + az * az);
            }
            const float alike = near * falloff(differ); // not in a branch, which would mask the loads
            const float w = guide[GUIDE_ID * size + q] == same[i] ? alike : 0.0f;
            EACH_PLANE(c, planes)
                sum[c][i] += w * value[c];
            weights[i] += w;
            variances[i] += w * w * v;
        }
    }
    LANE_LOOP
    for (int i = 0; i < end - first; i++) {
        // Where no tap counts this is 1, and the centre keeps its bits.
        const float scale = 1.0f / weights[i];
        EACH_PLANE(c, planes)
            store_out(signal_out + c * size, start + i, scale * sum[c][i]);
        store_stored_variance(variance_out, start + i, scale * scale * variances[i]);
    }
}

// Write the filtered columns of a row to the border.
static inline void wrap_filtered(
    int planes, SIGNAL_OUT signal_out, STORED_OUT variance_out, int first, int end, int y, int width,
    int height, int seam)
{
    EACH_PLANE(c, planes)
        wrap_out(signal_out + c * plane_size(width, height), first, end, y, width, seam);
    wrap_stored(variance_out, first, end, y, width, seam);
}

__kernel void filter_real(
    PLANES_IN guide[1],          // 7 planes
    SIGNAL_IN signal[1],         // its planes
    STORED_IN variance[1],       // 1 plane, of the mean of its guide scalar
    SIGNAL_OUT signal_out[1],    // out: its planes
    STORED_OUT variance_out[1],  // out: 1 plane
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    STORED_IN turned[1], // from smooth_real
    int step,                      // tap distance in pixels: 1, 2, 4, 8, 16
    float normal_sharpness,        // k_n
    float plane_sharpness,         // k_d
    float variance_scale,          // k_v^2
    float unit,                    // of signals in half precision, in the first and last level
    int width,
    int height,
    int seam)
{
    TILE_LANES_ITEM;
#ifdef GUIDED
    STORED_IN least = turned;
#else
    STORED_IN least = 0;
#endif
    filter_row(REAL_PLANES, REAL_TAPS, 0, 0, 0.0f, least, guide, signal, variance, signal_out,
               variance_out, first, end, y, step, normal_sharpness, plane_sharpness, variance_scale, unit,
               width, height);
    wrap_filtered(REAL_PLANES, signal_out, variance_out, first, end, y, width, height, seam);
}

__kernel void filter_reflected(
    PLANES_IN guide[MOST_ENTRIES],               // 7 planes
    SIGNAL_IN signal[MOST_ENTRIES],              // its planes
    STORED_IN variance[MOST_ENTRIES],            // 1 plane, of the mean of its guide scalar
    SIGNAL_OUT signal_out[MOST_ENTRIES],         // out: its planes
    STORED_OUT variance_out[MOST_ENTRIES],       // out: 1 plane
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    STORED_IN widened[MOST_ENTRIES],             // GGX alpha, from smooth_reflected; < 1e-4: copied
    int specular,                // number of specular signals
    float lobe_fraction,         // fraction of the lobe's half width that taps may span
    int step,                      // tap distance in pixels: 1, 2, 4, 8, 16
    float normal_sharpness,        // k_n
    float plane_sharpness,         // k_d
    float variance_scale,          // k_v^2
    float unit,                    // of signals in half precision, in the first and last level
    int width,
    int height,
    int seam)
{
    TILE_LANES_ITEM;
    filter_row(REFLECTED_PLANES, SPLINE_TAPS, entry < specular, widened, lobe_fraction, 0, guide, signal,
               variance, signal_out, variance_out, first, end, y, step, normal_sharpness, plane_sharpness,
               variance_scale, unit, width, height);
    wrap_filtered(REFLECTED_PLANES, signal_out, variance_out, first, end, y, width, height, seam);
}

// Return the GGX alpha of a whole pixel's lobe. The normals within a pixel turn its reflections by twice
// their angle, as alpha does (Kaplanyan et al. 2016; Tokuyoshi and Kaplanyan 2019, Eq. 1). Where surfaces
// bend within a pixel, one normal stands for many, and the neighbours' normals give their spread.
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
    return sqrt(alpha * alpha + NORMAL_SPREAD * turned);
}

// Return the least 1 - cosine between the normals of p and its eight neighbours; 0 if none is similar.
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

// Return the 3x3 binomial mean of the variance over pixels of one id: single estimates are too noisy to
// guide the weights (Schied et al. 2017, section 4.4).
static inline ALWAYS_INLINE float smoothed(PLANES_IN id, PLANES_IN variance, int stride, int p)
{
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
    return sum / weights;
}

// Prepare the levels' inputs: store the smoothed variance of a pixel.
static inline ALWAYS_INLINE void smooth_variance(
    PLANES_IN guide, PLANES_IN variance, STORED_OUT smooth, float unit, int width, int size, int p)
{
    float mean = smoothed(guide + GUIDE_ID * size, variance, plane_stride(width), p);
#ifdef HALF_PLANES
    mean = mean * unit * unit; // unit squared alone may overflow
#endif
    store_stored_variance(smooth, p, mean);
}

__kernel void smooth_real(
    PLANES_IN guide[1],      // 7 planes
    PLANES_IN variance[1],   // 1 plane
    STORED_OUT smooth[1],    // out: 1 plane
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    STORED_OUT turned[1], // out: 1 plane
    float unit,                    // of signals in half precision
    int width,
    int height,
    int seam)
{
    TILE_LANES_ITEM;
    const int size = plane_size(width, height), row = plane_index(0, y, width);
    LANE_LOOP
    for (int x = first; x < end; x++) {
        smooth_variance(guide, variance, smooth, unit, width, size, row + x);
        store_stored(turned, row + x, least_turn(guide, size, plane_stride(width), row + x));
    }
    wrap_stored(smooth, first, end, y, width, seam);
}

__kernel void smooth_reflected(
    PLANES_IN guide[MOST_ENTRIES],               // 7 planes
    PLANES_IN variance[MOST_ENTRIES],            // 1 plane; of specular signals the certainty, 2 planes
    STORED_OUT smooth[MOST_ENTRIES],             // out: 1 plane
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    PLANES_IN roughness[MOST_ENTRIES],           // GGX alpha
    STORED_OUT widened[MOST_ENTRIES],            // out: 1 plane
    int specular,                  // number of specular signals
    float unit,                    // of signals in half precision
    int width,
    int height,
    int seam)
{
    TILE_LANES_ITEM;
    const int size = plane_size(width, height), row = plane_index(0, y, width);
    LANE_LOOP
    for (int x = first; x < end; x++)
        smooth_variance(guide, variance, smooth, unit, width, size, row + x);
    wrap_stored(smooth, first, end, y, width, seam);
    if (entry >= specular)
        return;
    LANE_LOOP
    for (int x = first; x < end; x++) {
        const int p = row + x;
        const float alpha = roughness[p], wide = widened_alpha(guide, alpha, size, plane_stride(width), p);
#ifdef GUIDED
        // A single sample of a mirror is free of noise, but neighbours differ, as if by noise.
        const int sharp = (alpha < MIRROR_ALPHA) & is_short(variance[LENGTH_PLANE * size + p]);
#else
        const int sharp = alpha < MIRROR_ALPHA;
#endif
        store_stored(widened, p, sharp ? alpha : wide);
    }
}
