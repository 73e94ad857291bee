// History fix: pixels whose history is worth few samples take part of what neighbours of the same
// surface know, over a wide and sparse window, before the à-trous filter with its narrow first
// levels sees them (after NVIDIA's ReLAX). A lone sample of a rare event then no longer passes for
// the mean.
//
//   in    guide (7 planes, guide.h), signal (filter/signal.h) and the variance of its scalar g, length
//         (1 plane: how many samples the mean is worth), level of tracing
//   out   signal, variance: those of the other pixels are copied
//
// A neighbour weighs as much as its history is worth, times the falloff of the à-trous filter with
// normal and plane. Taps outside the picture are left out, across the seam they wrap.
#include "gbuffer/batch.h"
#include "gbuffer/guide.h"
#include "filter/signal.h"

#define TAPS 5         // in a row
#define SPARSEST 2     // level of one ray for 16 pixels
#define SPARSE 0.1667f // a ray each in four frames of 16 has met no object: there is nothing to fix

__kernel void fix_history(
    __global const float *restrict guide,    // 7 planes
    SPAN_PARAMETERS,                         // where there are surfaces
    __global const float *restrict signal,   // its planes
    __global const float *restrict variance, // 1 plane
    __global const float *restrict length,   // 1 plane
    __global const uchar *restrict level,    // of tracing, 1 plane (mask.cl)
    __global float *restrict signal_out,     // its planes
    __global float *restrict variance_out,   // 1 plane
    float stride,                            // pixels between taps where there is no history
    float enough,                            // histories of so many samples are left alone
    float normal_sharpness,                  // k_n of atrous.cl
    float plane_sharpness,                   // k_d
    int width,
    int height,
    int seam,
    int planes)
{
    SPAN_ITEM;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    float nx = guide[p], ny = guide[size + p], nz = guide[2 * size + p];
    float px = guide[3 * size + p], py = guide[4 * size + p], pz = guide[5 * size + p];
    float id = guide[GUIDE_ID * size + p], own = length[p];
    bool fixed = id > 0.0f && own > 0.0f && own < (level[p] == SPARSEST ? SPARSE * enough : enough);
    float plane_scale = plane_sharpness / sqrt(fmax(px * px + py * py + pz * pz, 1e-30f));

    float centre[REAL_PLANES], sum[REAL_PLANES];
    EACH_PLANE(c, planes) {
        centre[c] = signal[c * size + p];
        sum[c] = 0.0f; // of differences to the centre: equal neighbours leave its bits
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
