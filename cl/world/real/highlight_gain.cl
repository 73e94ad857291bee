// Limit on computed highlights from the captured picture (iprt/world/real/highlight_gain.py), in cells of the
// panorama (lib/world/real/gloss.h).
//
//   kernel               in                                   out
//   measure_reflectance  means over cells (measure_cells of   irradiance of the same material's cells around;
//                        highlight.cl)                        reflectance of cells; counts of cells
//   count_bins           reflectance, counts, chosen bins     histogram of the next digit
//   choose_bins          histogram, counts                    chosen bins; at last, the quantile per material
//                                                             and channel
//   average_across       means, irradiance, quantiles         Gaussian means along rows of seen radiance,
//                                                             diffuse radiance and highlight
//   limit_highlight      these, irradiance, quantiles         gain, and the least remainder
//
// A quantile is found digit by digit, from the highest: positive floats are ordered like their bits.
#include "world/brdf.h"

#define DARKER 0.25f  // quantile of a material's diffuse reflectance that bounds it from below everywhere
#define FAINT 0.25f   // highlights up to this fraction of the captured radiance leave the diffuse reflectance
                      // visible, and can be separated from it only roughly
#define LEAST 0.5f    // diffuse reflectance of a dark speck, relative to the material's darker parts
#define REACH 1.5f    // standard deviation of the Gaussian that averages texture, cells
#define BLURRED 6     // cells beyond which it ends
#define DIGIT 8       // bits
#define BINS (1 << DIGIT)

// Return the place of a digit's lowest bit; 0: the exponent.
static inline int digit_shift(int digit)
{
    return 23 - DIGIT * digit;
}

// Return whether cells with faint highlights alone make the quantile: at least a tenth are such.
static inline int are_faint(uint2 count)
{
    return 10u * count.y >= count.x + count.y;
}

// Return how many cells the quantile is of.
static inline uint cells_of(uint2 count)
{
    return are_faint(count) ? count.y : count.x + count.y;
}

// Return the 1 + index of a cell's coated material; 0: it has none. A conductor has no diffuse part.
static inline int coat_of(__global const float4 *restrict real_materials, float4 seen)
{
    const int index = (int)seen.w;
    return index && load_material(real_materials, index - 1).kind != KIND_CONDUCTOR ? index : 0;
}

__kernel void measure_reflectance(
    const int columns,
    const int rows,
    const int first_row,                           // of those with gloss
    __global const float4 *restrict real_materials,
    __global const float4 *restrict seen,          // w: 1 + index of the material; 0: none
    __global const float4 *restrict specular,
    __global const float4 *restrict irradiance,    // over pi
    __global float4 *restrict smooth,              // out: mean irradiance; w: 1 + index, -1: it is dark, 0: none
    __global float4 *restrict reflectance,         // out: w: 1 + index, and 0.5 if faint; 0: none
    __global uint *restrict counts)                // in, out: cells of each material; of these, faint ones
{
    const int x = get_global_id(0), y = first_row + get_global_id(1), cell = y * columns + x;
    if (x >= columns || y >= rows)
        return;
    const int index = coat_of(real_materials, seen[cell]);
    float3 sum = (float3)(0.0f);
    int count = 0;
    for (int i = 0; i < 9; i++) {
        const int right = (x + i % 3 - 1 + columns) % columns, down = clamp(y + i / 3 - 1, 0, rows - 1);
        const int beside = down * columns + right;
        if ((int)seen[beside].w != index)
            continue;
        sum += irradiance[beside].xyz;
        count++;
    }
    const float3 mean = sum / (float)max(count, 1), there = seen[cell].xyz, gleam = specular[cell].xyz;
    const int lit = index && fmin(fmin(mean.x, mean.y), mean.z) > 0.0f;
    const int faint = gleam.x + gleam.y + gleam.z <= FAINT * (there.x + there.y + there.z);
    smooth[cell] = (float4)(mean, lit ? (float)index : index ? -1.0f : 0.0f);
    const float3 found = fmax(there - gleam, 0.0f) / mean;
    reflectance[cell] = lit ? (float4)(found, index + 0.5f * faint) : (float4)(0.0f);
    if (lit)
        atomic_inc(counts + 2 * (index - 1) + faint);
}

__kernel void count_bins(
    const int columns,
    const int rows,
    const int first_row,
    const int digit,
    const int items,                               // materials x channels
    __global const float4 *restrict reflectance,
    __global const uint2 *restrict counts,
    __global const uint2 *restrict chosen,         // per item; x: the digits above
    __global uint *restrict bins)                  // in, out: BINS per digit and item
{
    const int x = get_global_id(0), y = first_row + get_global_id(1);
    if (x >= columns || y >= rows)
        return;
    const float4 value = reflectance[y * columns + x];
    const int material = (int)value.w - 1, faint = value.w > (int)value.w;
    if (material < 0 || (are_faint(counts[material]) && !faint))
        return;
    const uint3 bits = as_uint3(value.xyz) >> (uint)digit_shift(digit);
    for (int c = 0; c < 3; c++) {
        const int item = 3 * material + c;
        const uint digits = c == 0 ? bits.x : c == 1 ? bits.y : bits.z;
        if (digit == 0 || digits >> DIGIT == chosen[item].x)
            atomic_inc(bins + BINS * (digit * items + item) + (digits & (BINS - 1)));
    }
}

__kernel void choose_bins(
    const int digit,
    const int items,
    __global const uint4 *restrict bins,
    __global const uint2 *restrict counts,
    __global uint2 *restrict chosen,               // in, out: digits, and rank among the cells that have them
    __global float *restrict quantile)             // out: 4 per material, down to the digit
{
    const int item = get_global_id(0);
    if (item >= items)
        return;
    const int cells = (int)cells_of(counts[item / 3]);
    const uint rank = digit ? chosen[item].y : (uint)(DARKER * max(cells - 1, 0));
    uint end = 0, below = 0, bin = 0;
    for (int i = 0; i < BINS / 4; i++) {
        const uint4 n = bins[BINS / 4 * (digit * items + item) + i];
        // Bins that end at the rank or before are before the one that holds it.
        for (int k = 0; k < 4; k++) {
            end += k == 0 ? n.x : k == 1 ? n.y : k == 2 ? n.z : n.w;
            below = end <= rank ? end : below;
            bin += end <= rank;
        }
    }
    const uint digits = (digit ? chosen[item].x << DIGIT : 0u) | bin;
    chosen[item] = (uint2)(digits, rank - below);
    quantile[4 * (item / 3) + item % 3] = cells ? as_float(digits << digit_shift(digit)) : 0.0f;
}

// Return the diffuse radiance of a cell, from its irradiance.
static inline float3 diffuse_of(float4 smooth, __global const float4 *restrict quantile)
{
    return smooth.w > 0.0f ? quantile[(int)smooth.w - 1].xyz * smooth.xyz : (float3)(0.0f);
}

// Return the weight of a cell at a distance of `away` cells.
static inline float gaussian(int away)
{
    return exp(-0.5f * (away / REACH) * (away / REACH));
}

__kernel void average_across(
    const int columns,
    const int rows,
    const int first_row,
    __global const float4 *restrict seen,
    __global const float4 *restrict specular,
    __global const float4 *restrict smooth,
    __global const float4 *restrict quantile,
    __global float4 *restrict across)              // out: seen, diffuse, highlight per cell
{
    const int x = get_global_id(0), y = first_row + get_global_id(1);
    if (x >= columns || y >= rows)
        return;
    float3 mean = (float3)(0.0f), dark = mean, computed = mean;
    float weights = 0.0f;
    for (int dx = -BLURRED; dx <= BLURRED; dx++) {
        const int cell = y * columns + (x + dx + BLURRED * columns) % columns;
        const float weight = gaussian(dx);
        const float4 light = smooth[cell];
        weights += weight;
        if (light.w == 0.0f)
            continue;
        mean += weight * seen[cell].xyz;
        dark += weight * diffuse_of(light, quantile);
        computed += weight * specular[cell].xyz;
    }
    __global float4 *restrict sums = across + 3 * (y * columns + x);
    sums[0] = (float4)(mean / weights, 0.0f);
    sums[1] = (float4)(dark / weights, 0.0f);
    sums[2] = (float4)(computed / weights, 0.0f);
}

// Return the gain of one channel. Faint highlights are below the uncertainty of the diffuse radiance: they
// are kept.
static inline float channel_gain(float mean, float dark, float computed)
{
    if (!(computed > 0.0f && mean > 0.0f))
        return 1.0f;
    const float trust = fmin(computed / (FAINT * mean), 1.0f);
    return 1.0f + trust * trust * (clamp((mean - dark) / computed, 0.0f, 1.0f) - 1.0f);
}

__kernel void limit_highlight(
    const int columns,
    const int rows,
    const int first_row,
    const int row_count,                           // with gloss
    __global const float4 *restrict across,
    __global const float4 *restrict quantile,
    __global float4 *restrict gain,                // out: in [0, 1]; 1 where no cell nearby has gloss
    __global float4 *restrict min_base)            // smooth; out: radiance that the highlight leaves
{
    const int x = get_global_id(0), y = get_global_id(1), cell = y * columns + x;
    if (x >= columns || y >= rows)
        return;
    float3 mean = (float3)(0.0f), dark = mean, computed = mean;
    float weights = 0.0f;
    for (int dy = -BLURRED; dy <= BLURRED; dy++) {
        const int row = clamp(y + dy, 0, rows - 1);
        const float weight = gaussian(dy);
        weights += weight;
        if (row < first_row || row >= first_row + row_count)
            continue;
        __global const float4 *restrict sums = across + 3 * (row * columns + x);
        mean += weight * sums[0].xyz;
        dark += weight * sums[1].xyz;
        computed += weight * sums[2].xyz;
    }
    mean /= weights, dark /= weights, computed /= weights;
    const int own = y >= first_row && y < first_row + row_count;
    gain[cell] = (float4)(channel_gain(mean.x, dark.x, computed.x), channel_gain(mean.y, dark.y, computed.y),
                          channel_gain(mean.z, dark.z, computed.z), 0.0f);
    min_base[cell] = (float4)(own ? LEAST * diffuse_of(min_base[cell], quantile) : (float3)(0.0f), 0.0f);
}
