// One level of the edge-avoiding à-trous filter (IPRT "Filtering": 65x65 joint bilateral in five
// levels; Dammertz et al. 2010; variance guidance after Schied et al. 2017, SVGF Eqs. 2-5).
//
// All planes of a signal share one set of weights, so that E_R and E_RV are averaged over the
// same pixels before they are divided, and equal inputs give equal bits. The weight of a tap q is
//   B3(q) * falloff(k_n (1 - n_p . n_q) + k_d |n_p . (x_q - x_p)| / |x_p|
//                   + (g_p - g_q)^2 / (k_v^2 (v_p + v_q) + floor^2)) , 0 where ids differ,
// where g is the scalar that the picture shows (luminance of E_R - E_RV on real surfaces, of the
// signal on virtual ones) and v its variance. Both variances enter, so that a pixel which missed
// a rare event still takes part in what its noisy neighbours found.
//
//   in    guide (7 planes, guide.h), signal (SIGNAL_PLANES), variance (1) of g, roughness (1, GGX
//         alpha; -DSPECULAR), borders wrapped in equirect views
//   out   signal, variance: pixels without a surface are copied
//
// Build with -DSIGNAL_PLANES=3|6, -DDIFFERENCE for a real layer (planes E_R rgb, E_RV rgb),
// -DSPECULAR for specular radiance. Work groups of (n, 1) vectorize best on CPUs.
#include "guide.h"
#include "signal.h"

#define MIRROR_ALPHA 1e-4f

__kernel void filter_level(
    __global const float *restrict guide,        // 7 planes
    __global const float *restrict signal,       // SIGNAL_PLANES planes
    __global const float *restrict variance,     // of the guide scalar's mean
    __global float *restrict signal_out,         // SIGNAL_PLANES planes
    __global float *restrict variance_out,       // 1 plane
#ifdef SPECULAR
    __global const float *restrict roughness,    // GGX alpha, below 1e-4 a mirror: copied
    float lobe_fraction,                         // of the lobe's half width that taps may span
#endif
    int step,                                    // tap distance in pixels: 1, 2, 4, 8, 16
    float normal_sharpness,                      // k_n
    float plane_sharpness,                       // k_d
    float variance_scale,                        // k_v^2
    float floor_fraction,                        // floor, relative to the pixel's luminance
    int x0,                                      // rectangle's first column
    int y0,                                      // and row
    int x1,                                      // end column
    int y1,                                      // and row
    int width,
    int height)
{
    int x = x0 + (int)get_global_id(0), y = y0 + (int)get_global_id(1);
    if (x >= x1 || y >= y1)
        return;
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
        centre[c] = signal[c * size + p];
        sum[c] = 0.140625f * centre[c];
    }
    float weights = 0.140625f;
    float variances = 0.140625f * 0.140625f * variance[p];
    float g = guide_scalar(centre);
    float tolerance = floor_fraction * luminance((float3)(centre[0], centre[1], centre[2]));
    tolerance = variance_scale * variance[p] + tolerance * tolerance + 1e-30f;
    // No tap matches -2, so that a pixel without a surface keeps what it has.
    float same = id > 0.0f ? id : -2.0f;
#ifdef SPECULAR
    // The lobe of half width 2 alpha turns by twice the normal's angle and by the view angle.
    float alpha = roughness[p];
    same = alpha < MIRROR_ALPHA ? -2.0f : same;
    float span = 2.0f * lobe_fraction * fmax(alpha, MIRROR_ALPHA);
    float lobe = 0.5f / (span * span);
    normal_sharpness = fmax(normal_sharpness, 8.0f * lobe);
    lobe /= fmax(distance_squared, 1e-30f);
#endif

#ifdef SPECULAR
#define LOBE_TERM(DX, DY, DZ) + lobe * ((DX) * (DX) + (DY) * (DY) + (DZ) * (DZ))
#else
#define LOBE_TERM(DX, DY, DZ)
#endif
#define TAP(DX, DY, KERNEL)                                                                    \
    {                                                                                          \
        int q = p + step * (DX + DY * stride);                                                 \
        float turn = 1.0f - (nx * guide[q] + ny * guide[size + q] + nz * guide[2 * size + q]); \
        float qx = guide[3 * size + q], qy = guide[4 * size + q], qz = guide[5 * size + q];    \
        float off_plane = nx * qx + ny * qy + nz * qz - plane;                                 \
        float tap[SIGNAL_PLANES];                                                              \
        _Pragma("unroll") for (int c = 0; c < SIGNAL_PLANES; c++) tap[c] = signal[c * size + q]; \
        float dg = guide_scalar(tap) - g;                                                      \
        float v = variance[q];                                                                 \
        float x = normal_sharpness * fmax(turn, 0.0f) + plane_scale * fabs(off_plane)          \
                  + dg * dg / (variance_scale * v + tolerance)                                 \
                  LOBE_TERM(qx - px, qy - py, qz - pz);                                        \
        float w = guide[6 * size + q] == same ? KERNEL * falloff(x) : 0.0f;                    \
        _Pragma("unroll") for (int c = 0; c < SIGNAL_PLANES; c++) sum[c] += w * tap[c];        \
        weights += w;                                                                          \
        variances += w * w * v;                                                                \
    }
#define ROW(DY, KERNEL)                                                                        \
    TAP(-2, DY, KERNEL * 0.0625f)                                                              \
    TAP(-1, DY, KERNEL * 0.25f)                                                                \
    TAP(1, DY, KERNEL * 0.25f)                                                                 \
    TAP(2, DY, KERNEL * 0.0625f)
    ROW(-2, 0.0625f)
    TAP(0, -2, 0.0625f * 0.375f)
    ROW(-1, 0.25f)
    TAP(0, -1, 0.25f * 0.375f)
    ROW(0, 0.375f)
    ROW(1, 0.25f)
    TAP(0, 1, 0.25f * 0.375f)
    ROW(2, 0.0625f)
    TAP(0, 2, 0.0625f * 0.375f)

    // The quotient need not give back a lone centre's bits: copy it.
    bool alone = weights <= 0.140625f;
    float scale = 1.0f / weights;
    #pragma unroll
    for (int c = 0; c < SIGNAL_PLANES; c++)
        signal_out[c * size + p] = alone ? centre[c] : scale * sum[c];
    variance_out[p] = alone ? variance[p] : scale * scale * variances;
}

// 3x3 binomial mean of the variance over pixels of one id: single estimates are too noisy to
// steer the weights (Schied et al. 2017, section 4.4).
__kernel void smooth_variance(
    __global const float *restrict guide,    // 7 planes
    __global const float *restrict variance, // 1 plane
    __global float *restrict smooth,         // out: 1 plane
    int x0,                                  // rectangle's first column
    int y0,                                  // and row
    int x1,                                  // end column
    int y1,                                  // and row
    int width,
    int height)
{
    int x = x0 + (int)get_global_id(0), y = y0 + (int)get_global_id(1);
    if (x >= x1 || y >= y1)
        return;
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
    smooth[p] = sum / weights;
}
