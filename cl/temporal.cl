// Temporal accumulation with motion vectors, and the variance of its result (IPRT "Filtering",
// fading and clamping; moments after Schied et al. 2017, SVGF section 4.2).
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top.
//
//   kernel             in                                        out
//   reproject          guide of this and the previous picture,   history at this picture's pixels,
//                      motion (2 planes, previous position in    0 where there is none: signal,
//                      pixels; -1e9 = nowhere), history          length (how many samples it is
//                                                                worth), spread (variance of single
//                                                                samples of g)
//   clamp_history      guide, samples, history                   history near this picture's samples
//   accumulate         guide, samples, history                   history with the samples added,
//                                                                scalar g of it
//   estimate_variance  guide, g, spread, length                  variance of g's mean
//
// g is the scalar that the picture shows: the luminance of E_R - E_RV with -DDIFFERENCE (a real
// layer: planes E_R rgb, E_RV rgb), else the signal's. Without clamping and fading, and motion
// that stays on the pixel, the accumulated signal is the plain mean of the samples. A sample that
// is not finite is dropped. Build with -DSIGNAL_PLANES=3|6, -DVIEW_EQUIRECT for equirect views.
#include "guide.h"
#include "signal.h"

#define HUGE 1e30f            // samples from here on, and NaN, are not used
#define MAX_LENGTH 1e6f
#define SHORT_HISTORY 4.0f    // below, samples of one pixel do not tell their variance
#define SPATIAL_RADIUS 3
#define CLAMP_STEP 2

// Reads a pixel's signal; the planes from 3 on as differences to the first three.
inline void load_differences(float *s, __global const float *signal, int size, int p)
{
    #pragma unroll
    for (int c = 0; c < SIGNAL_PLANES; c++)
        s[c] = signal[c * size + p] - (c < 3 ? 0.0f : signal[(c - 3) * size + p]);
}

inline bool all_finite(const float *s)
{
    float total = 0.0f;
    #pragma unroll
    for (int c = 0; c < SIGNAL_PLANES; c++)
        total += fabs(s[c]);
    return total < HUGE;
}

__kernel void reproject(
    __global const float *restrict guide,          // 7 planes
    __global const float *restrict guide_previous, // 7 planes
    __global const float *restrict motion,         // 2 planes
    __global const float *restrict signal_before,  // SIGNAL_PLANES planes
    __global const float *restrict length_before,  // 1 plane
    __global const float *restrict spread_before,  // 1 plane
    __global float *restrict signal,               // out: SIGNAL_PLANES planes
    __global float *restrict length,               // out: 1 plane
    __global float *restrict spread,               // out: 1 plane
    float plane_tolerance,                         // plane distance / depth of one surface
    float normal_agreement,                        // least cosine between its normals
    int width,
    int height)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int size = plane_size(width, height);
    int p = plane_index(x, y, width);
    float nx = guide[p], ny = guide[size + p], nz = guide[2 * size + p];
    float px = guide[3 * size + p], py = guide[4 * size + p], pz = guide[5 * size + p];
    float id = guide[6 * size + p];
    float tolerance = plane_tolerance * sqrt(px * px + py * py + pz * pz);

    float past[SIGNAL_PLANES];
    for (int c = 0; c < SIGNAL_PLANES; c++)
        past[c] = 0.0f;
    float weights = 0.0f, samples = 0.0f, variation = 0.0f;
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
                past[c] += w * signal_before[c * size + q];
            samples += w * length_before[q];
            variation += w * spread_before[q];
            weights += w;
        }
    }
    // A lone tap on the pixel centre has weight 1 and stays exact.
    bool found = weights > 0.01f;
    for (int c = 0; c < SIGNAL_PLANES; c++)
        signal[c * size + p] = found ? past[c] / weights : 0.0f;
    length[p] = found ? samples / weights : 0.0f;
    spread[p] = found ? variation / weights : 0.0f;
}

// Clamps the history to mean +- sigma deviations of this picture's neighbourhood, a box that also
// holds the new sample (IPRT "Filtering"). Nine samples two pixels apart reach as far as a 5x5 box
// for a third of its reads. E_RV is clamped by its difference to E_R: where no object has
// influence that box is a point, so an old shadow goes at once although E_R itself is noisy.
__kernel void clamp_history(
    __global const float *restrict guide,   // 7 planes
    __global const float *restrict samples, // SIGNAL_PLANES planes, border wrapped
    __global float *restrict signal,        // in, out: SIGNAL_PLANES planes of history
    __global float *restrict length,        // in, out: 1 plane, lowered where anything moved
    float sigma,                            // half width of the box in deviations
    float clamped_length,                   // samples that a clamped history is worth
    int width,
    int height)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    float id = guide[GUIDE_ID * size + p];
    float centre[SIGNAL_PLANES], mean[SIGNAL_PLANES], square[SIGNAL_PLANES];
    load_differences(centre, samples, size, p);
    if (!(id > 0.0f && all_finite(centre)))
        return;
    #pragma unroll
    for (int c = 0; c < SIGNAL_PLANES; c++)
        mean[c] = square[c] = 0.0f;
    float count = 0.0f;
    #pragma unroll
    for (int i = 0; i < 9; i++) {
        int q = p + CLAMP_STEP * (i % 3 - 1 + (i / 3 - 1) * plane_stride(width));
        float s[SIGNAL_PLANES];
        load_differences(s, samples, size, q);
        bool used = guide[GUIDE_ID * size + q] == id && all_finite(s);
        count += used ? 1.0f : 0.0f;
        #pragma unroll
        for (int c = 0; c < SIGNAL_PLANES; c++) {
            // About the centre, which may be large against the spread.
            float d = used ? s[c] - centre[c] : 0.0f;
            mean[c] += d;
            square[c] += d * d;
        }
    }
    float value[SIGNAL_PLANES], clamped[SIGNAL_PLANES], scale = 1.0f / count;
    load_differences(value, signal, size, p);
    bool moved = false;
    #pragma unroll
    for (int c = 0; c < SIGNAL_PLANES; c++) {
        float m = scale * mean[c];
        float deviation = sigma * sqrt(fmax(scale * square[c] - m * m, 0.0f));
        float low = centre[c] + fmin(m - deviation, 0.0f);
        float high = centre[c] + fmax(m + deviation, 0.0f);
        clamped[c] = fmin(fmax(value[c], low), high);
        moved = moved || clamped[c] != value[c];
        clamped[c] += c < 3 ? 0.0f : clamped[c - 3];
    }
    if (!moved)
        return;
    #pragma unroll
    for (int c = 0; c < SIGNAL_PLANES; c++)
        signal[c * size + p] = clamped[c];
    length[p] = fmin(length[p], clamped_length);
}

__kernel void accumulate(
    __global const float *restrict guide,   // 7 planes
    __global const float *restrict samples, // SIGNAL_PLANES planes
    __global const uchar *restrict level,   // 1 plane: how densely this picture was traced
    __global float *restrict signal,        // in: history, out: accumulated, SIGNAL_PLANES planes
    __global float *restrict length,        // in, out: 1 plane
    __global float *restrict spread,        // in, out: 1 plane
    __global float *restrict scalar,        // out: 1 plane, g of the result
    float fading,                           // least share of the new sample, 0: plain mean
    int width,
    int height)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int size = plane_size(width, height);
    int p = plane_index(x, y, width);
    float past[SIGNAL_PLANES], sample[SIGNAL_PLANES];
    #pragma unroll
    for (int c = 0; c < SIGNAL_PLANES; c++) {
        past[c] = signal[c * size + p];
        sample[c] = samples[c * size + p];
    }
    float before = length[p], variation = spread[p];
    bool usable = guide[GUIDE_ID * size + p] > 0.0f && all_finite(sample);
    bool first = !(before > 0.0f);
    // Pixels that share one ray have a part of its weight: a lone hit that was spread over many of
    // them gives way to the rays of their own that follow.
    int spacing = level_spacing(usable ? level[p] : 0);
    float worth = 1.0f / (spacing * spacing);
    float share = first ? 1.0f : fmax(worth / (before + worth), fading * worth);
    // Fading makes the mean worth (2 - fading) / fading samples at most: so a later, longer
    // average goes on from the right weight.
    float limit = fading > 0.0f ? fmin(2.0f / fading - 1.0f, MAX_LENGTH) : MAX_LENGTH;
    float step = guide_scalar(sample) - guide_scalar(past);
    float varied = first ? 0.0f : (1.0f - share) * (variation + share * step * step);
    #pragma unroll
    for (int c = 0; c < SIGNAL_PLANES; c++) {
        float mean = first ? sample[c] : past[c] + share * (sample[c] - past[c]);
        past[c] = usable ? mean : signal[c * size + p];
        signal[c * size + p] = past[c];
    }
    length[p] = usable ? fmin(before + worth, limit) : before;
    spread[p] = usable ? varied : variation;
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
