// Highlights that the capture centre sees on glossy real surfaces, and the panorama without them.
//
// Equirect texels (row 0 the zenith), world-space, metres. `list` holds the glossy texels, row * width +
// column; gloss 0 means diffuse, else 1 + index into the table of real materials.
//
//   kernel            in                                        out
//   sample_highlight  real layer                                highlight, list's texels: radiance
//                                                               and variance of the mean's
//                                                               luminance
//   filter_highlight  highlight, surface                        highlight of the list's texels
//   measure_cells     highlight, real layer                     means over the glossy texels of
//                                                               cells of CELL x CELL texels: color
//                                                               (w: their gloss, 0 none), highlight,
//                                                               irradiance / pi
//   remove_highlight  color, highlight, gain, min_base (per cell)  highlight, all texels: the specular
//                                                               part, within [0, color]; radiated:
//                                                               the radiance for rays
//
// The gain corrects for unknown properties of the surfaces, see
// iprt/world/real/highlight_gain.py.
//
// The reflection at x towards the centre is the integral of f_s(wo, wi) L(x, wi) cos over the specular
// lobe, by rays sampled from the lobe's visible normals (lib/world/brdf.h). L is the captured radiance
// where the ray ends: a highlight in it counts as if it were diffuse. Its second reflection is a few
// percent of a coat, so that a further iteration would change nothing visible.
//
// A conductor only reflects. Its radiance in other directions is unknown. Rays that meet one find the
// captured radiance, a reflection of another side but closer than black.
#include "maths/listed_items.h"
#include "world/brdf.h"
#include "world/real/gloss.h"
#include "world/world.h"

// Planes whose g (lib/world/real/real.h) differ by this fraction, in distance or angle, are one surface.
#define PLANE_TOLERANCE 0.1f
// Differences up to this many standard deviations, squared, count as noise.
#define DEVIATIONS_SQUARED 9.0f
// Fraction of the lobe's half width, 2 alpha, that taps span.
#define LOBE_FRACTION 0.25f

static inline ALWAYS_INLINE float3 texel_point(const RealLayer real, int texel)
{
    const int width = real.grid.width;
    const float3 v = texel_direction(texel % width, texel / width, width, real.grid.height);
    const float3 g = real.surface[texel].xyz;
    return v * surface_radius(0.0f, dot(g, v), 1.0f, 1.0f, real.grid.range[texel]);
}

TRACING_KERNEL void sample_highlight(
    const int most_rays,                            // per texel; fewer where texels crowd: poles
    const int frame_seed,
    __global const int *restrict list,
    const int count,
    __global const int *restrict gloss,
    __global const float4 *restrict real_materials, // lib/world/brdf.h
    __global const float4 *restrict real_reflectance, // per real material: reflectance of conductors
    const RealLayer real,
    __global float *restrict highlight,             // out: 3 a texel
    __global float *restrict variance,
    const Work work)   // out
{
    LIST_ITEM(count);
    COUNT_ITEM;
    const float3 shown = texel_point(real, list[item]);
    const float c = shown.y / length(shown), sine = sqrt(fmax(1.0f - c * c, 0.0f));
    const int rays = max((int)(most_rays * sine + 0.5f), min(most_rays, 2));
    float3 sum = (float3)(0.0f);
    float mean = 0.0f, spread = 0.0f;   // of luminance, by Welford's recurrence
    for (int ray = 0; ray < rays; ray++) {
        const int texel = READ_AGAIN(list + item), index = gloss[texel] - 1;
        const float3 n = -normalize(real.surface[texel].xyz), p = texel_point(real, texel);
        const Frame frame = build_frame(n);
        const uint seed =
            hash_combine(hash_combine((uint)texel, 0x676c6f73u), (uint)frame_seed);
        const BrdfSample sample = sample_specular(
            load_material(real_materials, index), real_reflectance[index].xyz, frame,
            brdf_local_wo(frame, -p / length(p)), sobol_2d(ray, seed));
        float3 found = (float3)(0.0f);
        if (sample.weight.x + sample.weight.y + sample.weight.z > 0.0f) {
            const RealHit hit =
                trace_real_layer(real, real_start(real, p, n), sample.wi, INFINITY);
            found = sample.weight * captured_radiance(real, hit, sample.wi);
        }
        sum += found;
        const float step = luminance(found) - mean;
        mean += step / (ray + 1);
        spread += step * (luminance(found) - mean);
    }
    vstore3(sum / (float)rays, list[item], highlight);
    variance[list[item]] = spread / ((float)rays * max(rays - 1, 1));
}

// One level of an à-trous filter over texels of one material (Dammertz et al. 2010; SVGF Eqs. 2 to 5). Taps
// count on the same plane, with a luminance difference within the noise, and no farther apart than the lobe
// is wide. The first level averages variances, which few rays do not determine, and ignores luminance.
__kernel void filter_highlight(
    const int step,                              // tap distance in texels
    __global const int *restrict list,
    const int count,
    __global const int *restrict gloss,
    __global const float4 *restrict real_materials,
    const RealLayer real,
    __global const float *restrict highlight,    // 3 a texel
    __global const float *restrict variance,
    __global float *restrict filtered,           // out: as highlight
    __global float *restrict filtered_variance,
    const Work work)   // out
{
    LIST_ITEM(count);
    COUNT_ITEM;
    const int texel = list[item], column = texel % real.grid.width, row = texel / real.grid.width;
    const float4 centre = (float4)(vload3(texel, highlight), variance[texel]);
    const float3 g = real.surface[texel].xyz;
    const float plane = 1.0f / (PLANE_TOLERANCE * PLANE_TOLERANCE * dot(g, g));
    // Width in texels.
    const float span = 2.0f * LOBE_FRACTION * real.grid.height / IPRT_PI
        * load_material(real_materials, gloss[texel] - 1).alpha;
    const float lobe = 0.5f / fmax(span * span, 1e-30f);
    const float c = 0.5f * (real.grid.row[row] + real.grid.row[row + 1]), squeeze = 1.0f - c * c;

    float4 sum = (float4)(0.0f);
    float weights = 0.0f;
    for (int dy = -2; dy <= 2; dy++) {
        const int y = row + dy * step;
        if (y < 0 || y >= real.grid.height)
            continue;
        for (int dx = -2; dx <= 2; dx++) {
            int x = (column + dx * step) % real.grid.width;
            x = x < 0 ? x + real.grid.width : x;
            const int q = y * real.grid.width + x;
            if (gloss[q] != gloss[texel])
                continue;
            const float4 tap = (float4)(vload3(q, highlight), variance[q]);
            const float3 bend = real.surface[q].xyz - g;
            const float apart = step * step * (dx * dx * squeeze + dy * dy);
            const float differ = step > 1 ? luminance(tap.xyz) - luminance(centre.xyz) : 0.0f;
            const float noise = DEVIATIONS_SQUARED * (tap.w + centre.w) + 1e-30f;
            const float kernel_weight = (dx == 0 ? 0.375f : abs(dx) == 1 ? 0.25f : 0.0625f)
                * (dy == 0 ? 0.375f : abs(dy) == 1 ? 0.25f : 0.0625f);
            const float weight = kernel_weight
                * falloff(plane * dot(bend, bend) + lobe * apart + differ * differ / noise);
            sum += (float4)(weight * tap.xyz, weight * weight * tap.w);
            weights += weight;
        }
    }
    vstore3(sum.xyz / weights, texel, filtered);
    filtered_variance[texel] = sum.w / (weights * weights);
}

TRACING_KERNEL void measure_cells(
    const int rays,                                 // per cell, for the irradiance
    const int frame_seed,
    const int columns,
    const int rows,
    __global const int *restrict gloss,
    const RealLayer real,
    __global const float *restrict highlight,       // 3 a texel
    __global float4 *restrict seen,                 // out: columns x rows
    __global float4 *restrict specular,                // out
    __global float4 *restrict irradiance,            // out
    const Work work)
{
    const int cell_x = get_global_id(0), cell_y = get_global_id(1);
    if (cell_x >= columns || cell_y >= rows)
        return;
    COUNT_ITEM;
    const int x1 = min((cell_x + 1) * CELL, real.grid.width), y1 = min((cell_y + 1) * CELL, real.grid.height);
    int index = 0, count = 0;
    int texels[CELL * CELL];
    float3 seen_sum = (float3)(0.0f), specular_sum = (float3)(0.0f);
    for (int y = cell_y * CELL; y < y1; y++)
        for (int x = cell_x * CELL; x < x1; x++) {
            const int texel = y * real.grid.width + x;
            index = index ? index : gloss[texel];
            if (!index || gloss[texel] != index)
                continue;
            texels[count++] = texel;
            seen_sum += vload3(texel, real.color);
            specular_sum += vload3(texel, highlight);
        }
    const int cell = cell_y * columns + cell_x;
    const float scale = 1.0f / max(count, 1);
    float3 sum = (float3)(0.0f);
    const uint seed = hash_combine(hash_combine((uint)cell, 0x63656c6cu), (uint)frame_seed);
    for (int ray = 0; ray < rays && count > 0; ray++) {
        const int texel = texels[ray % max(count, 1)];
        const float3 n = -normalize(real.surface[texel].xyz), p = texel_point(real, texel);
        const float3 d = frame_to_world(build_frame(n), sample_cosine(sobol_2d(ray, seed)));
        const RealHit hit = trace_real_layer(real, real_start(real, p, n), d, INFINITY);
        sum += captured_radiance(real, hit, d);
    }
    seen[cell] = (float4)(scale * seen_sum, (float)index);
    specular[cell] = (float4)(scale * specular_sum, 0.0f);
    irradiance[cell] = (float4)(sum / (float)rays, 0.0f);
}

__kernel void remove_highlight(
    const int width,
    const int height,
    __global const int *restrict gloss,
    __global const float4 *restrict real_materials,
    __global const float *restrict color,        // 3 a texel: captured radiance
    const int columns,                           // cells
    const int rows,
    __global const float4 *restrict gain,        // float4 per cell
    __global const float4 *restrict min_base,       // float4 per cell: least remainder without the highlight
    __global float *restrict highlight,          // in, out: 3 a texel
    __global float *restrict radiated)           // out: 3 a texel
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int texel = y * width + x;
    const float3 seen = vload3(texel, color);
    float3 specular = (float3)(0.0f), left = seen;
    if (gloss[texel]) {
        const int conductor =
            load_material(real_materials, gloss[texel] - 1).kind == KIND_CONDUCTOR;
        const float2 at = (float2)(x + 0.5f, y + 0.5f);
        const float3 share = gain_at(gain, columns, rows, at);
        const float3 most = fmax(seen - gain_at(min_base, columns, rows, at), 0.0f);
        specular = clamp(share * vload3(texel, highlight), (float3)(0.0f), most);
        specular = conductor ? seen : specular;
        left = conductor ? seen : seen - specular;
    }
    vstore3(specular, texel, highlight);
    vstore3(left, texel, radiated);
}
