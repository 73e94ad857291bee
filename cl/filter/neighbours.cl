// Reconstruction from neighbours of the same surface: of pixels without a ray (interpolate), and of pixels
// with a short history (fix_history).
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top.
//
// interpolate: IPRT Algorithm 2, with joint bilateral weights in place of weights that grow with distance.
//
//   in      guide (7 planes, guide.h), level (1 plane of uchar, 255 = no surface)
//   in out  signal (filter/signal.h): valid at traced pixels, afterwards at all with a
//           surface; 0 where there is none. It runs in place: only untraced pixels change,
//           and only traced ones are read. All planes share one set of weights.
//
// fix_history: a pixel with a short history is blended with neighbours of the same surface, over a wide and
// sparse window, before the à-trous filter with its narrow first levels (after NVIDIA's ReLAX). A lone
// sample of a rare event is then no longer taken for the mean.
//
//   in    guide (7 planes, guide.h), signal and its certainty (filter/signal.h), level of tracing
//   out   signal, variance: the other pixels' are copied
//
// A neighbour's weight is the length of its history times the falloff of the à-trous filter with normal and
// plane. Taps outside the picture are left out; across the seam they wrap.
#include "gbuffer/batch.h"
#include "gbuffer/guide.h"
#include "filter/signal.h"

#define SEARCH 3   // the coarsest grid (spacing 4) has a point within this distance of any pixel
#define TAPS 5         // in a row
#define SPARSEST 2     // level of one ray for 16 pixels
#define SPARSE 0.1667f // a ray each in four frames of 16 has met no object: nothing to fix

// Return the level of the pixel, LEVEL_NONE outside the picture.
static inline int level_at(
    __global const uchar *restrict level, int x, int y, int width, int height, int seam)
{
    x = wrap_column(x, width, seam);
    bool inside = x >= 0 && x < width && y >= 0 && y < height;
    return inside ? level[plane_index(x, y, width)] : LEVEL_NONE;
}

// Return the plane index of the pixel if it got a ray in this frame, else -1.
static inline int traced_at(
    __global const uchar *restrict level, int x, int y, int2 offset, int width, int height,
    int seam)
{
    int there = level_at(level, x, y, width, height, seam);
    x = wrap_column(x, width, seam);
    return is_traced(there, x - offset.x, y - offset.y) ? plane_index(x, y, width) : -1;
}

__kernel void interpolate(
    PLANES_IN guide[MOST_ENTRIES],               // 7 planes
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    __global const uchar *restrict level[MOST_ENTRIES], // 1 plane
    __global float *signal[MOST_ENTRIES],        // in, out: its planes
    float normal_sharpness,               // falloff per 1 - cos of the normals' angle
    float plane_sharpness,                // falloff per plane distance / depth
    __global const int *restrict origin,  // x y of the tracing grid in this frame
    int width,
    int height,
    int seam,
    int planes)
{
    TILE_ITEM;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    int own = level[p];
    int2 offset = vload2(0, origin);
    if (is_traced(own, x - offset.x, y - offset.y)) {
        if (seam)
            EACH_PLANE(c, planes)
                store_border(signal + c * size, p, x, width, seam, signal[c * size + p]);
        return;
    }
    float sum[REAL_PLANES];
    EACH_PLANE(c, planes)
        sum[c] = 0.0f;
    float weights = 0.0f;
    if (own != LEVEL_NONE) {
        int spacing = level_spacing(own);
        int left = x - ((x - offset.x) & (spacing - 1)), top = y - ((y - offset.y) & (spacing - 1));
        // A corner of the level-1 grid in a level-2 area may have no ray.
        for (int i = 0; i < 4 && spacing == 2; i++) {
            int cx = left + 2 * (i & 1), cy = top + 2 * (i >> 1);
            if (level_at(level, cx, cy, width, height, seam) == 2
                && traced_at(level, cx, cy, offset, width, height, seam) < 0)
                spacing = 4;
        }
        left = x - ((x - offset.x) & (spacing - 1));
        top = y - ((y - offset.y) & (spacing - 1));
        float nx = guide[p], ny = guide[size + p], nz = guide[2 * size + p];
        float px = guide[3 * size + p], py = guide[4 * size + p], pz = guide[5 * size + p];
        float id = guide[6 * size + p];
        float plane_scale = plane_sharpness / sqrt(fmax(px * px + py * py + pz * pz, 1e-30f));
        for (int i = 0; i < 4; i++) {
            int cx = left + spacing * (i & 1), cy = top + spacing * (i >> 1);
            int q = traced_at(level, cx, cy, offset, width, height, seam);
            if (q < 0)
                continue;
            float turn = 1.0f - (nx * guide[q] + ny * guide[size + q] + nz * guide[2 * size + q]);
            float off_plane = nx * (guide[3 * size + q] - px) + ny * (guide[4 * size + q] - py)
                              + nz * (guide[5 * size + q] - pz);
            float w = (spacing - abs(cx - x)) * (spacing - abs(cy - y))
                      * falloff(normal_sharpness * fmax(turn, 0.0f)
                                + plane_scale * fabs(off_plane));
            w = guide[6 * size + q] == id ? w : 0.0f;
            EACH_PLANE(c, planes)
                sum[c] += w * signal[c * size + q];
            weights += w;
        }
        if (weights < 1e-3f) {
            // No corner is similar to this pixel: take the nearest ray of its surface, else the nearest.
            int nearest = -1, distance = 1 << 20;
            for (int dy = -SEARCH; dy <= SEARCH; dy++)
                for (int dx = -SEARCH; dx <= SEARCH; dx++) {
                    int q = traced_at(level, x + dx, y + dy, offset, width, height, seam);
                    if (q < 0)
                        continue;
                    int d = dx * dx + dy * dy + (guide[6 * size + q] == id ? 0 : 1 << 10);
                    nearest = d < distance ? q : nearest;
                    distance = min(d, distance);
                }
            weights = nearest < 0 ? 0.0f : 1.0f;
            EACH_PLANE(c, planes)
                sum[c] = nearest < 0 ? 0.0f : signal[c * size + nearest];
        }
    }
    EACH_PLANE(c, planes)
        store_wrapped(signal + c * size, p, x, width, seam,
                      weights > 0.0f ? sum[c] / weights : 0.0f);
}

__kernel void fix_history(
    __global const float *restrict guide,    // 7 planes
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    __global const float *restrict signal,   // its planes
    __global const float *restrict certainty, // 2 planes
    __global const uchar *restrict level,    // of tracing, 1 plane (mask.cl)
    __global float *restrict signal_out,     // its planes
    __global float *restrict variance_out,   // 1 plane
    float stride,                            // pixels between taps without any history
    float enough,                            // longer histories are unchanged
    float normal_sharpness,                  // k_n of atrous.cl
    float plane_sharpness,                   // k_d
    int width,
    int height,
    int seam,
    int planes)
{
    TILE_ITEM;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    PLANES_IN variance = certainty + VARIANCE_PLANE * size;
    PLANES_IN length = certainty + LENGTH_PLANE * size;
    float nx = guide[p], ny = guide[size + p], nz = guide[2 * size + p];
    float px = guide[3 * size + p], py = guide[4 * size + p], pz = guide[5 * size + p];
    float id = guide[GUIDE_ID * size + p], own = length[p];
    bool fixed = id > 0.0f && own > 0.0f && own < (level[p] == SPARSEST ? SPARSE * enough : enough);
    float plane_scale = plane_sharpness / sqrt(fmax(px * px + py * py + pz * pz, 1e-30f));

    float centre[REAL_PLANES], sum[REAL_PLANES];
    EACH_PLANE(c, planes) {
        centre[c] = signal[c * size + p];
        sum[c] = 0.0f; // of differences to the centre: equal neighbours preserve its bits
    }
    float weights = own, variances = own * own * variance[p];
    int step = max((int)(stride / (1.0f + own) + 0.5f), 1);
    for (int i = 0; fixed && i < TAPS * TAPS; i++) {
        int dx = i % TAPS - TAPS / 2, dy = i / TAPS - TAPS / 2;
        int tx = wrap_column(x + step * dx, width, seam), ty = y + step * dy;
        if (tx < 0 || tx >= width || ty < 0 || ty >= height || (dx == 0 && dy == 0))
            continue;
        int q = plane_index(tx, ty, width);
        if (guide[GUIDE_ID * size + q] != id)
            continue;
        float turn = 1.0f - (nx * guide[q] + ny * guide[size + q] + nz * guide[2 * size + q]);
        float off_plane = nx * (guide[3 * size + q] - px) + ny * (guide[4 * size + q] - py)
                          + nz * (guide[5 * size + q] - pz);
        float w = length[q]
                  * falloff(normal_sharpness * fmax(turn, 0.0f) + plane_scale * fabs(off_plane));
        EACH_PLANE(c, planes)
            sum[c] += w * (signal[c * size + q] - centre[c]);
        variances += w * w * variance[q];
        weights += w;
    }
    float scale = fixed ? 1.0f / weights : 0.0f;
    EACH_PLANE(c, planes)
        store_wrapped(signal_out + c * size, p, x, width, seam, centre[c] + scale * sum[c]);
    store_wrapped(variance_out, p, x, width, seam, fixed ? scale * scale * variances : variance[p]);
}
