// Temporal accumulation with motion vectors, and the variance of its result (IPRT "Filtering",
// fading and clamping; moments after Schied et al. 2017, SVGF section 4.2).
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top.
//
//   kernel             in                                        out
//   accumulate         guide of this and the previous picture,   accumulated signal, length (how
//                      motion (2 planes, previous position in    many samples it is worth), spread
//                      pixels; -1e9 = nowhere), signal, history  (variance of single samples of g),
//                      (signal, length, spread)                  scalar g
//   estimate_variance  guide, g, spread, length                  variance of g's mean
//
// g is the scalar that the picture shows: the luminance of E_R - E_RV with -DDIFFERENCE (a real
// layer: planes E_R rgb, E_RV rgb), else the signal's. Without clamping and fading, and motion
// that stays on the pixel, the accumulated signal is the plain mean of the samples. A sample that
// is not finite is dropped. Build with -DSIGNAL_PLANES=3|6, -DCLAMP_RADIUS=n, -DVIEW_EQUIRECT for
// equirect views.
#include "guide.h"

#define MAX_LENGTH 1e6f
#define SHORT_HISTORY 4.0f    // below, samples of one pixel do not tell their variance
#define SPATIAL_RADIUS 3

inline float guide_scalar(const float *s)
{
#ifdef DIFFERENCE
    return luminance(s[0] - s[3], s[1] - s[4], s[2] - s[5]);
#else
    return luminance(s[0], s[1], s[2]);
#endif
}

// Reads a pixel's signal; the planes from 3 on as differences to the first three.
inline void load_box_sample(float *s, __global const float *restrict signal, int size, int p)
{
    #pragma unroll
    for (int c = 0; c < SIGNAL_PLANES; c++)
        s[c] = signal[c * size + p] - (c < 3 ? 0.0f : s[c - 3]);
}

inline bool all_finite(const float *s)
{
    float total = 0.0f;
    #pragma unroll
    for (int c = 0; c < SIGNAL_PLANES; c++)
        total += fabs(s[c]);
    return total < 1e30f;
}

// Clamps the history to mean +- sigma of this picture's neighbourhood, which also holds `sample`.
// E_RV is clamped by its difference to E_R: where no object has influence that box is a point,
// so an old shadow goes at once although E_R itself is noisy. Returns whether anything moved.
inline bool clamp_history(
    float *history,
    __global const float *restrict guide,
    __global const float *restrict signal,
    float sigma,
    int p,
    int size,
    int stride)
{
    float mean[SIGNAL_PLANES], square[SIGNAL_PLANES], low[SIGNAL_PLANES], high[SIGNAL_PLANES];
    load_box_sample(low, signal, size, p);
    for (int c = 0; c < SIGNAL_PLANES; c++) {
        mean[c] = square[c] = 0.0f;
        high[c] = low[c];
    }
    float id = guide[GUIDE_ID * size + p], count = 0.0f;
    for (int dy = -CLAMP_RADIUS; dy <= CLAMP_RADIUS; dy++)
        for (int dx = -CLAMP_RADIUS; dx <= CLAMP_RADIUS; dx++) {
            int q = p + dx + dy * stride;
            float s[SIGNAL_PLANES];
            load_box_sample(s, signal, size, q);
            if (guide[GUIDE_ID * size + q] != id || !all_finite(s))
                continue;
            count += 1.0f;
            for (int c = 0; c < SIGNAL_PLANES; c++) {
                // Relative to the centre, whose value may be large against the spread.
                mean[c] += s[c] - high[c];
                square[c] += (s[c] - high[c]) * (s[c] - high[c]);
            }
        }
    bool moved = false;
    for (int c = 0; c < SIGNAL_PLANES; c++) {
        float m = mean[c] / count;
        float deviation = sigma * sqrt(fmax(square[c] / count - m * m, 0.0f));
        low[c] += fmin(m - deviation, 0.0f);
        high[c] += fmax(m + deviation, 0.0f);
        float value = history[c] - (c < 3 ? 0.0f : history[c - 3]);
        moved |= value < low[c] || value > high[c];
    }
    if (moved) {
        // Differences first: they are taken to the base before it moves.
        for (int c = SIGNAL_PLANES - 1; c >= 0; c--) {
            float value = history[c] - (c < 3 ? 0.0f : history[c - 3]);
            history[c] = fmin(fmax(value, low[c]), high[c]);
        }
        for (int c = 3; c < SIGNAL_PLANES; c++)
            history[c] += history[c - 3];
    }
    return moved;
}

__kernel void accumulate(
    __global const float *restrict guide,          // 7 planes
    __global const float *restrict guide_previous, // 7 planes
    __global const float *restrict motion,         // 2 planes
    __global const float *restrict signal,         // SIGNAL_PLANES planes, border wrapped
    __global const float *restrict history,        // SIGNAL_PLANES planes
    __global const float *restrict length_before,  // 1 plane
    __global const float *restrict spread_before,  // 1 plane
    __global float *restrict accumulated,          // out: SIGNAL_PLANES planes
    __global float *restrict length_after,         // out: 1 plane
    __global float *restrict spread_after,         // out: 1 plane
    __global float *restrict scalar,               // out: 1 plane, g of the result
    float fading,                                  // least share of the new sample, 0: plain mean
    float plane_tolerance,                         // plane distance / depth of one surface
    float normal_agreement,                        // least cosine between its normals
    int changed,                                   // whether to clamp the history
    float clamp_sigma,                             // half width of the box
    float clamped_length,                          // samples that a clamped history is worth
    int width,
    int height)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int size = plane_size(width, height), stride = plane_stride(width);
    int p = plane_index(x, y, width);
    float nx = guide[p], ny = guide[size + p], nz = guide[2 * size + p];
    float px = guide[3 * size + p], py = guide[4 * size + p], pz = guide[5 * size + p];
    float id = guide[6 * size + p];
    float tolerance = plane_tolerance * sqrt(px * px + py * py + pz * pz);

    float past[SIGNAL_PLANES];
    for (int c = 0; c < SIGNAL_PLANES; c++)
        past[c] = 0.0f;
    float weights = 0.0f, length = 0.0f, spread = 0.0f;
    float mx = motion[p] - 0.5f, my = motion[size + p] - 0.5f;
    if (id > 0.0f && fabs(mx) < 1e6f && fabs(my) < 1e6f) {
        int left = (int)floor(mx), top = (int)floor(my);
        float fx = mx - left, fy = my - top;
        for (int i = 0; i < 4; i++) {
            int tx = wrap_column(left + (i & 1), width), ty = top + (i >> 1);
            float w = ((i & 1) ? fx : 1.0f - fx) * ((i >> 1) ? fy : 1.0f - fy);
            if (!(w > 0.0f) || tx < 0 || tx >= width || ty < 0 || ty >= height)
                continue;
            int q = plane_index(tx, ty, width);
            float cosine = nx * guide_previous[q] + ny * guide_previous[size + q]
                           + nz * guide_previous[2 * size + q];
            float off_plane = nx * (guide_previous[3 * size + q] - px)
                              + ny * (guide_previous[4 * size + q] - py)
                              + nz * (guide_previous[5 * size + q] - pz);
            if (guide_previous[6 * size + q] != id || !(fabs(off_plane) <= tolerance)
                || !(cosine >= normal_agreement) || !(length_before[q] > 0.0f))
                continue;
            for (int c = 0; c < SIGNAL_PLANES; c++)
                past[c] += w * history[c * size + q];
            length += w * length_before[q];
            spread += w * spread_before[q];
            weights += w;
        }
    }
    if (weights > 0.01f) {
        // A lone tap on the pixel centre has weight 1 and stays exact.
        for (int c = 0; c < SIGNAL_PLANES; c++)
            past[c] /= weights;
        length /= weights;
        spread /= weights;
    } else {
        length = 0.0f;
        spread = 0.0f;
    }

    float sample[SIGNAL_PLANES];
    for (int c = 0; c < SIGNAL_PLANES; c++)
        sample[c] = signal[c * size + p];
    bool usable = id > 0.0f && all_finite(sample);
    if (changed && usable && length > 0.0f
        && clamp_history(past, guide, signal, clamp_sigma, p, size, stride))
        length = fmin(length, clamped_length);

    float share = fmax(1.0f / (length + 1.0f), fading);
    // Fading makes the mean worth (2 - fading) / fading samples at most: so a later, longer
    // average goes on from the right weight.
    float limit = fading > 0.0f ? fmin(2.0f / fading - 1.0f, MAX_LENGTH) : MAX_LENGTH;
    if (usable) {
        float step = guide_scalar(sample) - guide_scalar(past);
        spread = length > 0.0f ? (1.0f - share) * (spread + share * step * step) : 0.0f;
        for (int c = 0; c < SIGNAL_PLANES; c++)
            past[c] = length > 0.0f ? past[c] + share * (sample[c] - past[c]) : sample[c];
        length = fmin(length + 1.0f, limit);
    } else if (!(length > 0.0f)) {
        for (int c = 0; c < SIGNAL_PLANES; c++)
            past[c] = 0.0f;
    }
    for (int c = 0; c < SIGNAL_PLANES; c++)
        accumulated[c * size + p] = past[c];
    length_after[p] = length;
    spread_after[p] = spread;
    scalar[p] = guide_scalar(past);
}

__kernel void estimate_variance(
    __global const float *restrict guide,  // 7 planes
    __global const float *restrict scalar, // 1 plane, border wrapped
    __global const float *restrict spread, // 1 plane
    __global const float *restrict length, // 1 plane
    __global float *restrict variance,     // out: 1 plane, of the scalar's mean
    int width,
    int height)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int stride = plane_stride(width), p = plane_index(x, y, width);
    __global const float *restrict ids = guide + GUIDE_ID * plane_size(width, height);
    float samples = length[p], result = 0.0f;
    if (samples >= SHORT_HISTORY - 0.5f) { // the mean of four lengths of 4 may round down
        result = spread[p] / (samples - 1.0f);
    } else if (ids[p] > 0.0f) {
        float id = ids[p], centre = scalar[p], count = 0.0f, sum = 0.0f, square = 0.0f;
        for (int dy = -SPATIAL_RADIUS; dy <= SPATIAL_RADIUS; dy++)
            for (int dx = -SPATIAL_RADIUS; dx <= SPATIAL_RADIUS; dx++) {
                int q = p + dx + dy * stride;
                float same = ids[q] == id ? 1.0f : 0.0f, d = same * (scalar[q] - centre);
                count += same;
                sum += d;
                square += d * d;
            }
        // Raised while samples are few, so that the first pictures are filtered strongly.
        float boost = SHORT_HISTORY / fmax(samples, 1.0f);
        result = boost * fmax(square / count - sum * sum / (count * count), 0.0f);
    }
    variance[p] = result;
}
