// Learning of local linear models from samples: recursive least squares with forgetting (Eqs. 6 and 7 of W.
// Lee et al. 2022), and a step of stochastic gradient descent of the bandwidth (Eq. 8) for each sample. A
// work item has one model, and processes the samples around it in order.
//
// P of Eq. 6 is kept as its inverse, to which a sample adds w x x^T: it stays positive definite in single
// precision. -D PRIOR is its initial value, the inverse of 1e5.
//
// in      samples      world/real/draw_samples.cl, sorted by cells
//         start        the first sample of each cell, and the end of the last one's
// in, out models       lib/world/real/learned.h
//         information  6 a model: P^-1, upper triangle row by row
#include "world/real/learned.h"

// Samples before which errors are ignored: the model is not determined yet.
#define ERRORS_FROM 4.0f
// Samples after which the forgetting factor has its final value.
#define FORGETTING_SAMPLES 256.0f
// Largest change of the bandwidth by a sample.
#define LARGEST_STEP 0.1f

// Return P x.
static inline float3 gain_of(const float *a, float3 x)
{
    // Cholesky: P^-1 = L L^T.
    const float l00 = sqrt(a[0]), l10 = a[1] / l00, l20 = a[2] / l00;
    const float l11 = sqrt(fmax(a[3] - l10 * l10, PRIOR));
    const float l21 = (a[4] - l20 * l10) / l11;
    const float l22 = sqrt(fmax(a[5] - l20 * l20 - l21 * l21, PRIOR));
    const float z0 = x.x / l00, z1 = (x.y - l10 * z0) / l11;
    const float z2 = (x.z - l20 * z0 - l21 * z1) / l22;
    const float y2 = z2 / l22, y1 = (z1 - l21 * y2) / l11;
    return (float3)((z0 - l10 * y1 - l20 * y2) / l00, y1, y2);
}

__kernel void learn_models(
    const int count,                            // of models
    const float radius,                         // search radius, metres
    const float first_forgetting,               // lambda of the first sample
    const float last_forgetting,                // lambda after FORGETTING_SAMPLES
    const float unit,                           // errors are relative to this radiance and the model's
    const float rate,                           // of the gradient descent
    const float slopes_penalty,                 // gamma_1
    const float bandwidth_penalty,              // gamma_2, in units of the search radius
    __global const int *restrict start,
    __global const float4 *restrict samples,
    __global float4 *restrict models,
    __global float *restrict information)
{
    const int item = get_global_id(0);
    if (item >= count)
        return;
    __global float4 *model = models + MODEL_PARTS * item;
    const float3 centre = model[0].xyz, normal = model[1].xyz;
    const Frame frame = build_frame(normal);
    const float inverse_radius = 1.0f / radius, widest = radius / sqrt(-2.0f * log(LEAST_WEIGHT));
    float bandwidth = model[0].w, learned = model[1].w, weights = model[2].w, errors = model[3].w;
    float3 level = model[2].xyz, slope_x = model[3].xyz, slope_y = model[4].xyz;
    float a[6];
    for (int i = 0; i < 6; i++)
        a[i] = information[6 * item + i];

    const float reach = bandwidth / widest * radius;
    const int3 low = grid_cell(centre - reach, inverse_radius);
    const int3 high = grid_cell(centre + reach, inverse_radius);
    const int3 span = high - low + 1;
    const int cells = min(span.x, 3) * min(span.y, 3) * min(span.z, 3);
    for (int cell = 0; cell < cells; cell++) {
        const int3 offset =
            (int3)(cell % span.x, cell / span.x % span.y, cell / (span.x * span.y));
        const int place = grid_place(low + offset), end = start[place + 1];
        for (int i = start[place]; i < end; i++) {
            __global const float4 *sample = samples + SAMPLE_PARTS * i;
            const float4 at = sample[0];
            const float3 d = at.xyz - centre;
            const float weight = model_weight(d, bandwidth);
            if (!(weight >= LEAST_WEIGHT && dot(sample[1].xyz, normal) >= ALIKE_NORMAL))
                continue;
            const float3 x = (float3)(1.0f, dot(d, frame.x) * inverse_radius,
                                      dot(d, frame.y) * inverse_radius);
            const float3 e = sample[2].xyz - (level + x.y * slope_x + x.z * slope_y);

            // Eqs. 6 and 7. Information never falls below the prior.
            const float forgetting = mix(first_forgetting, last_forgetting,
                                         fmin(learned / FORGETTING_SAMPLES, 1.0f));
            a[0] = fmax(forgetting * a[0], PRIOR) + weight;
            a[1] = forgetting * a[1] + weight * x.y;
            a[2] = forgetting * a[2] + weight * x.z;
            a[3] = fmax(forgetting * a[3], PRIOR) + weight * x.y * x.y;
            a[4] = forgetting * a[4] + weight * x.y * x.z;
            a[5] = fmax(forgetting * a[5], PRIOR) + weight * x.z * x.z;
            const float3 gain = gain_of(a, x);
            // Eq. 8: the derivative with respect to the logarithm of the bandwidth. A weight's is
            // w r^2 / b^2. The derivative of the coefficients with respect to a weight is P x e; J_1 is
            // minimal for the coefficients. All use coefficients from before the sample.
            if (learned >= ERRORS_FROM) {
                const float scale = 1.0f / (unit + fmax(luminance(level), 0.0f));
                const float shown = scale * scale / 3.0f, squared = fmin(shown * dot(e, e), 1e4f);
                weights = forgetting * weights + weight;
                errors = forgetting * errors + weight * squared;
                const float moves = shown
                    * dot(gain.x * level + gain.y * slope_x + gain.z * slope_y, e);
                const float b = bandwidth * inverse_radius;
                const float apart = dot(d, d) / (bandwidth * bandwidth);
                const float gradient = weight * apart
                        * (squared - errors / weights + 2.0f * slopes_penalty * weights * moves)
                    - weight * 4.0f * bandwidth_penalty / (b * b * b * b);
                const float change = clamp(-rate * gradient, -LARGEST_STEP, LARGEST_STEP);
                bandwidth = clamp(bandwidth * exp(change), fmin(at.w, widest), widest);
            }
            level += weight * gain.x * e;
            slope_x += weight * gain.y * e;
            slope_y += weight * gain.z * e;
            learned = fmin(learned + 1.0f, 1e6f);
        }
    }
    model[0] = (float4)(centre, bandwidth);
    model[1] = (float4)(normal, learned);
    model[2] = (float4)(level, weights);
    model[3] = (float4)(slope_x, errors);
    model[4] = (float4)(slope_y, 0.0f);
    for (int i = 0; i < 6; i++)
        information[6 * item + i] = a[i];
}
