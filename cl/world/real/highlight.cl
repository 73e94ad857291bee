// Highlights that the capture centre sees on glossy real surfaces, and the panorama without them.
//
// Equirect texels (row 0 the zenith), world-space, metres. gloss 0 means diffuse, else 1 + index into the
// table of real materials. A lobe is sampled at sites: one texel in each block of a material, blocks as wide
// as its lobe allows. The cells of the gain, CELL x CELL texels, have rays of their own.
//
//   kernel            in                          out
//   trace_sites       real layer, sites           paths: where rays of a site's lobe end
//   trace_cells       real layer                  paths of a cell's cosine lobe
//   gather_sites      paths, pictures             samples, per site: radiance; variance of the mean's
//                                                 luminance
//   filter_sites      samples, surface            samples
//   measure_cells     samples, paths of cells     radiated of glossy texels: their highlight, interpolated;
//                                                 means over a cell's: color (w: their gloss, 0 none),
//                                                 highlight, irradiance / pi
//   remove_highlight  color, radiated, gain, min_base (per cell)  radiated, all texels: the radiance for
//                                                 rays, color without the specular part
//
// The gain corrects for unknown properties of the surfaces, see iprt/world/real/highlight_gain.py.
//
// The reflection at x towards the centre is the integral of f_s(wo, wi) L(x, wi) cos over the specular
// lobe, by rays sampled from the lobe's visible normals (lib/world/brdf.h). L is the captured radiance
// where the ray ends: a highlight in it counts as if it were diffuse. Its second reflection is a few
// percent of a coat, so that a further iteration would change nothing visible.
//
// Paths are kept from frame to frame: light that changes is looked up where they end. Rays are traced again
// where surfaces have changed on their way.
//
// A conductor only reflects. Its radiance in other directions is unknown. Rays that meet one find the
// captured radiance, a reflection of another side but closer than black.
#include "maths/listed_items.h"
#include "world/brdf.h"
#include "world/real/gloss.h"
#include "world/real/kept_paths.h"

// Planes whose g (lib/world/real/real.h) differ by this fraction, in distance or angle, are one surface.
#define PLANE_TOLERANCE 0.1f
// Differences up to this many standard deviations, squared, count as noise.
#define DEVIATIONS_SQUARED 9.0f
// Fraction of the lobe's half width, 2 alpha, that taps span.
#define LOBE_FRACTION 0.25f
// Least weight of the sites around a texel that determine it.
#define LEAST_SUPPORT 1e-3f

static inline ALWAYS_INLINE float3 texel_point(const RealLayer real, int texel)
{
    const int width = real.grid.width;
    const float3 v = texel_direction(texel % width, texel / width, width, real.grid.height);
    const float3 g = real.surface[texel].xyz;
    return v * surface_radius(0.0f, dot(g, v), 1.0f, 1.0f, real.grid.range[texel]);
}

// Return the rays of a texel; fewer where texels crowd: at the poles.
static inline int rays_at(int most_rays, int row, int height)
{
    const float sine = sin((row + 0.5f) * IPRT_PI / height);
    return max((int)(most_rays * sine + 0.5f), min(most_rays, 2));
}

TRACING_KERNEL void trace_sites(
    const int most_rays,                            // per site
    const int frame_seed,
    __global const int *restrict sites,             // blocks that have a site
    const int count,
    __global const int *restrict blocks,            // texel of each block's site, -1: none
    __global const float4 *restrict cones,          // directions in which surfaces have changed
    const int cone_count,                           // negative: everywhere
    __global const uchar *restrict gloss,
    __global const float4 *restrict real_materials, // lib/world/brdf.h
    const RealLayer real,
    __global float4 *restrict paths,                // in, out: most_rays per block
    const Work work)   // out
{
    LIST_ITEM(count);
    const int block = sites[item];
    const int rays = rays_at(most_rays, blocks[block] / real.grid.width, real.grid.height);
    COUNT_ITEM;
    for (int ray = 0; ray < rays; ray++) {
        const int texel = READ_AGAIN(blocks + block), index = gloss[texel] - 1;
        const float3 n = -normalize(real.surface[texel].xyz), p = texel_point(real, texel);
        if (!outdated(cones, cone_count, normalize(p), paths[block * most_rays + ray]))
            continue;
        const Frame frame = build_frame(n);
        const uint seed =
            hash_combine(hash_combine((uint)texel, 0x676c6f73u), (uint)frame_seed);
        // A coat reflects all colors alike.
        const BrdfSample sample = sample_specular(
            load_material(real_materials, index), (float3)(0.0f), frame,
            brdf_local_wo(frame, -p / length(p)), sobol_2d(ray, seed));
        float4 path = (float4)(0.0f, 0.0f, 0.0f, NO_PICTURE);
        if (sample.weight.x > 0.0f)
            path = path_of(real, p, n, sample.wi, sample.weight.x);
        paths[block * most_rays + ray] = path;
    }
}

// Return a mask of the texels of the first material in a cell, row by row; 0: none is glossy.
static inline ulong cell_texels(__global const uchar *restrict gloss, int width, int height, int x, int y)
{
    const int columns = min(CELL, width - x * CELL), rows = min(CELL, height - y * CELL);
    int index = 0;
    ulong texels = 0;
    for (int row = 0; row < rows; row++)
        for (int column = 0; column < columns; column++) {
            const int found = gloss[(y * CELL + row) * width + x * CELL + column];
            index = index ? index : found;
            if (index && found == index)
                texels |= (ulong)1 << (row * CELL + column);
        }
    return texels;
}

TRACING_KERNEL void trace_cells(
    const int rays,                                 // per cell
    const int frame_seed,
    const int columns,
    const int rows,
    __global const float4 *restrict cones,          // trace_sites
    const int cone_count,
    __global const uchar *restrict gloss,
    const RealLayer real,
    __global float4 *restrict paths,                // in, out: `rays` per cell
    const Work work)
{
    const int cell_x = get_global_id(0), cell_y = get_global_id(1);
    if (cell_x >= columns || cell_y >= rows)
        return;
    const int cell = cell_y * columns + cell_x;
    const ulong texels = cell_texels(gloss, real.grid.width, real.grid.height, cell_x, cell_y);
    if (texels == 0)
        return;
    COUNT_ITEM;
    const uint seed = hash_combine(hash_combine((uint)cell, 0x63656c6cu), (uint)frame_seed);
    ulong left = 0;
    for (int ray = 0; ray < rays; ray++) {
        left = left ? left : texels;
        const int next = popcount((left & -left) - 1);
        left &= left - 1;
        const int texel = (cell_y * CELL + next / CELL) * real.grid.width + cell_x * CELL + next % CELL;
        const float3 n = -normalize(real.surface[texel].xyz), p = texel_point(real, texel);
        if (!outdated(cones, cone_count, normalize(p), paths[cell * rays + ray]))
            continue;
        const float3 d = frame_to_world(build_frame(n), sample_cosine(sobol_2d(ray, seed)));
        paths[cell * rays + ray] = path_of(real, p, n, d, 1.0f);
    }
}

__kernel void gather_sites(
    const int most_rays,
    __global const int *restrict sites,
    const int count,
    __global const int *restrict blocks,
    const RealLayer real,
    __global const float4 *restrict paths,
    __global float4 *restrict samples,           // out, per block
    const Work work)
{
    LIST_ITEM(count);
    COUNT_ITEM;
    const int block = sites[item];
    const int rays = rays_at(most_rays, blocks[block] / real.grid.width, real.grid.height);
    float3 sum = (float3)(0.0f);
    float mean = 0.0f, spread = 0.0f;   // of luminance, by Welford's recurrence
    for (int ray = 0; ray < rays; ray++) {
        const float3 found = path_radiance(real, paths[block * most_rays + ray]);
        sum += found;
        const float step = luminance(found) - mean;
        mean += step / (ray + 1);
        spread += step * (luminance(found) - mean);
    }
    samples[block] = (float4)(sum / (float)rays, spread / ((float)rays * max(rays - 1, 1)));
}

// Blocks of a material.
typedef struct {
    int first;
    int columns;
    int rows;
    int stride;   // texels
} Blocks;

static inline Blocks blocks_of(__global const int4 *restrict layout, int gloss)
{
    const int4 row = layout[gloss - 1];
    return (Blocks){row.x, row.y, row.z, row.w};
}

// Return the index of a block, -1: it has no site. Wraps around in azimuth.
static inline int block_at(__global const int *restrict blocks, const Blocks of, int column, int row)
{
    if (row < 0 || row >= of.rows)
        return -1;
    const int x = column % of.columns;
    const int block = of.first + row * of.columns + (x < 0 ? x + of.columns : x);
    return blocks[block] < 0 ? -1 : block;
}

static inline float plane_scale(float3 g)
{
    return 1.0f / (PLANE_TOLERANCE * PLANE_TOLERANCE * dot(g, g));
}

// One level of an à-trous filter over sites of one material (Dammertz et al. 2010; SVGF Eqs. 2 to 5). Taps
// count on the same plane, with a luminance difference within the noise, and no farther apart than the lobe
// is wide. The first level averages variances, which few rays do not determine, and ignores luminance.
__kernel void filter_sites(
    const int step,                              // tap distance in blocks
    __global const int *restrict sites,
    const int count,
    __global const int *restrict blocks,
    __global const int4 *restrict layout,
    __global const uchar *restrict gloss,
    __global const float4 *restrict real_materials,
    const RealLayer real,
    __global const float4 *restrict samples,
    __global float4 *restrict filtered,          // out
    const Work work)
{
    LIST_ITEM(count);
    COUNT_ITEM;
    const int block = sites[item], texel = blocks[block];
    const Blocks of = blocks_of(layout, gloss[texel]);
    const int column = (block - of.first) % of.columns, row = (block - of.first) / of.columns;
    const float4 centre = samples[block];
    const float3 g = real.surface[texel].xyz;
    const float plane = plane_scale(g);
    // Width in texels.
    const float span = 2.0f * LOBE_FRACTION * real.grid.height / IPRT_PI
        * load_material(real_materials, gloss[texel] - 1).alpha;
    const float lobe = 0.5f / fmax(span * span, 1e-30f), apart = (float)(step * of.stride);
    const int y = texel / real.grid.width;
    const float c = 0.5f * (real.grid.row[y] + real.grid.row[y + 1]), squeeze = 1.0f - c * c;

    float4 sum = (float4)(0.0f);
    float weights = 0.0f;
    for (int dy = -2; dy <= 2; dy++)
        for (int dx = -2; dx <= 2; dx++) {
            const int q = block_at(blocks, of, column + dx * step, row + dy * step);
            if (q < 0)
                continue;
            const float4 tap = samples[q];
            const float3 bend = real.surface[blocks[q]].xyz - g;
            const float distant = apart * apart * (dx * dx * squeeze + dy * dy);
            const float differ = step > 1 ? luminance(tap.xyz) - luminance(centre.xyz) : 0.0f;
            const float noise = DEVIATIONS_SQUARED * (tap.w + centre.w) + 1e-30f;
            const float kernel_weight = (dx == 0 ? 0.375f : abs(dx) == 1 ? 0.25f : 0.0625f)
                * (dy == 0 ? 0.375f : abs(dy) == 1 ? 0.25f : 0.0625f);
            const float weight = kernel_weight
                * falloff(plane * dot(bend, bend) + lobe * distant + differ * differ / noise);
            sum += (float4)(weight * tap.xyz, weight * weight * tap.w);
            weights += weight;
        }
    filtered[block] = (float4)(sum.xyz / weights, sum.w / (weights * weights));
}

// Return the highlight of a texel between the sites around it, on its own plane if one of them is.
static inline float3 between_sites(
    __global const int *restrict blocks, const Blocks of, __global const float4 *restrict samples,
    const RealLayer real, int texel)
{
    const int x = texel % real.grid.width, y = texel / real.grid.width;
    const float2 at = ((float2)(x, y) + 0.5f) / (float)of.stride - 0.5f;
    const float2 corner = floor(at), share = at - corner;
    const float3 g = real.surface[texel].xyz;
    const float plane = plane_scale(g);
    float3 sum = (float3)(0.0f);
    float weights = 0.0f;
    for (int i = 0; i < 4; i++) {
        const int right = i & 1, below = i >> 1;
        const int q = block_at(blocks, of, (int)corner.x + right, (int)corner.y + below);
        if (q < 0)
            continue;
        const float3 bend = real.surface[blocks[q]].xyz - g;
        const float weight = (right ? share.x : 1.0f - share.x) * (below ? share.y : 1.0f - share.y)
            * falloff(plane * dot(bend, bend));
        sum += weight * samples[q].xyz;
        weights += weight;
    }
    // The block of the texel itself has a site.
    if (!(weights > LEAST_SUPPORT))
        return samples[block_at(blocks, of, x / of.stride, y / of.stride)].xyz;
    return sum / weights;
}

__kernel void measure_cells(
    const int rays,
    const int columns,
    const int rows,
    __global const int *restrict blocks,
    __global const int4 *restrict layout,
    __global const float4 *restrict samples,
    __global const float4 *restrict paths,          // of cells
    __global const uchar *restrict gloss,
    const RealLayer real,
    __global float *restrict radiated,              // out: 3 a texel
    __global float4 *restrict seen,                 // out: columns x rows
    __global float4 *restrict specular,             // out
    __global float4 *restrict irradiance,           // out
    const Work work)
{
    const int cell_x = get_global_id(0), cell_y = get_global_id(1);
    if (cell_x >= columns || cell_y >= rows)
        return;
    COUNT_ITEM;
    const int width = real.grid.width, x1 = min((cell_x + 1) * CELL, width);
    const int y1 = min((cell_y + 1) * CELL, real.grid.height);
    int index = 0, count = 0;
    float3 seen_sum = (float3)(0.0f), specular_sum = seen_sum, light = seen_sum;
    for (int y = cell_y * CELL; y < y1; y++)
        for (int x = cell_x * CELL; x < x1; x++) {
            const int texel = y * width + x;
            index = index ? index : gloss[texel];
            if (!gloss[texel])
                continue;
            const Blocks of = blocks_of(layout, gloss[texel]);
            const float3 found = of.stride > 0
                ? between_sites(blocks, of, samples, real, texel)
                : (float3)(0.0f);
            vstore3(found, texel, radiated);
            if (gloss[texel] != index)
                continue;
            count++;
            seen_sum += vload3(texel, real.color);
            specular_sum += found;
        }
    const int cell = cell_y * columns + cell_x;
    for (int ray = 0; ray < rays && count > 0; ray++)
        light += path_radiance(real, paths[cell * rays + ray]);
    const float scale = 1.0f / max(count, 1);
    seen[cell] = (float4)(scale * seen_sum, (float)index);
    specular[cell] = (float4)(scale * specular_sum, 0.0f);
    irradiance[cell] = (float4)(light / (float)rays, 0.0f);
}

__kernel void remove_highlight(
    const int width,
    const int height,
    __global const uchar *restrict gloss,
    __global const float4 *restrict real_materials,
    __global const float *restrict color,        // 3 a texel: captured radiance
    const int columns,                           // cells
    const int rows,
    __global const float4 *restrict gain,        // float4 per cell
    __global const float4 *restrict min_base,       // float4 per cell: least remainder without the highlight
    __global float *restrict radiated)           // in, out: 3 a texel
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int texel = y * width + x;
    const float3 seen = vload3(texel, color);
    float3 left = seen;
    if (gloss[texel]) {
        const int conductor =
            load_material(real_materials, gloss[texel] - 1).kind == KIND_CONDUCTOR;
        const float2 at = (float2)(x + 0.5f, y + 0.5f);
        const float2 size = (float2)((float)columns, (float)rows);
        const float3 share = gain_at(gain, columns, rows, size, at);
        const float3 most = fmax(seen - gain_at(min_base, columns, rows, size, at), 0.0f);
        const float3 specular = clamp(share * vload3(texel, radiated), (float3)(0.0f), most);
        left = conductor ? seen : seen - specular;
    }
    vstore3(left, texel, radiated);
}
