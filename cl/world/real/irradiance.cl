// The irradiance cache of the panorama: E_R / pi per cell of an equirect grid, refined over frames where
// needed and kept while the video is static (lib/world/real/irradiance.h).
//
//   kernel         in                                           out
//   place_cells    panorama (lib/world/real/real.h)             plane: tangent plane of each entry
//                                                               (w 0: none, or a window; else 1 +
//                                                               samples forgotten); point: its
//                                                               position; means of moved surfaces reset
//   move_cells     panorama, camera (lib/gbuffer/camera.h),     the same, reprojected from the previous
//                  previous plane, mean and smooth              axes
//   list_cells     pixels that are traced (list, count, guide,  entries around them with too few
//                  touched), objects' boxes, mean               samples, each once
//   refine_cells   cells, point, world (lib/world/world.h)      mean: rgb / pi, w samples; then, per entry
//                                                               again, xyz the flux (irradiance.h)
//   smooth_cells   cells, point, mean                           smooth: joint filter of mean, narrower
//                                                               with every sample
//   show_cells     guide, smooth                                3 planes: rgb / pi at the pixels
#include "world/boxes.h"
#include "gbuffer/camera.h"
#include "world/direction.h"
#include "world/real/irradiance.h"
#include "gbuffer/planes.h"
#include "maths/listed_items.h"
#include "maths/sampling.h"

#define SMOOTH_RADIUS 3
// Most texels along a cell's side in which its second surface is searched.
#define MOST_ACROSS 8
// Samples after which a cell weighs the same as all others around it together.
#define OWN_SAMPLES 32.0f
// The variance of light along the surface is unbounded: its share of the flux uses this cosine.
#define LEAST_COSINE 0.1f
// Relative distance up to which a cell's surface is the same.
#define SAME_PLACE 0.02f

// The sample index continues, so that forgotten samples are not drawn again.
#define MOST_FORGOTTEN 4194304.0f

static inline float forgotten(float before, float more)
{
    const float all = before + fmax(more, 0.0f);
    return all < MOST_FORGOTTEN ? all : 0.0f;
}

typedef struct {
    int width;
    int height;
    __global const float4 *surface;
} Texels;

// Return the tangent plane of a texel; 0 for open sky or a window.
static inline float4 texel_plane(Texels real, int column, int row)
{
    const float4 surface = real.surface[row * real.width + column];
    const int usable = !((int)surface.w & (SURFACE_NONE | SURFACE_OPENING));
    return usable ? (float4)(surface.xyz, 1.0f) : (float4)(0.0f);
}

static inline float4 plane_at(Texels real, float x, float y, int columns, int rows)
{
    return texel_plane(real, min((int)(x / columns * real.width), real.width - 1),
                       min((int)(y / rows * real.height), real.height - 1));
}

// Return whether two tangent planes belong to one surface, or neither is a surface.
static inline int same_surface(float4 one, float4 other)
{
    const float3 apart = one.xyz - other.xyz;
    return (one.w > 0.0f) == (other.w > 0.0f)
        && dot(apart, apart) <= SAME_PLACE * SAME_PLACE * dot(one.xyz, one.xyz);
}

// Return a texel's tangent plane, point and normal. The texel may lie beyond the seam.
static inline float4 texel_surface(Texels real, int column, int row, float3 *p, float3 *n)
{
    const int x = (column + real.width) % real.width, y = clamp(row, 0, real.height - 1);
    const float4 plane = texel_plane(real, x, y);
    const float3 v = texel_direction(x, y, real.width, real.height);
    *p = v / fmax(dot(plane.xyz, v), 1e-30f);
    *n = -normalize(plane.xyz);
    return plane;
}

// Return whether a texel shows a surface that continues in its neighbours and is at the centre of no cell
// around.
static inline int is_thin(Texels real, int column, int row, int x, int y, int columns, int rows)
{
    // Most texels of a cell show the same surface as its centre.
    if (same_surface(texel_plane(real, column, row), plane_at(real, x + 0.5f, y + 0.5f, columns, rows)))
        return 0;
    float3 p, n, q, m;
    const float4 plane = texel_surface(real, column, row, &p, &n);
    if (!(plane.w > 0.0f))
        return 0;
    for (int i = 0; i < 9; i++) {
        const int cell = cache_cell(columns, rows, x + (i + 1) % 3 - 1, y + (i / 3 + 1) % 3 - 1);
        const float4 centre = plane_at(real, cell % columns + 0.5f, cell / columns + 0.5f, columns, rows);
        if (cache_agreement(centre, p, n) > 0.0f)
            return 0;
    }
    int joined = 0;
    for (int i = 0; i < 4; i++) {
        const int aside = i < 2 ? 2 * i - 1 : 0, down = i < 2 ? 0 : 2 * i - 5;
        const float4 other = texel_surface(real, column + aside, row + down, &q, &m);
        joined += other.w > 0.0f && cache_agreement(plane, q, m) > 0.0f;
    }
    return joined >= 2;
}

// Return (column, row) of the texel nearest to the centre that shows a cell's second surface; (-1, -1):
// none.
static inline int2 thin_texel(Texels real, int x, int y, int columns, int rows)
{
    const int across = clamp(real.width / columns, 1, MOST_ACROSS);
    int2 nearest = (int2)(-1);
    float least = INFINITY;
    for (int i = 0; i < across * across; i++) {
        const float2 inside = ((float2)(i % across, i / across) + 0.5f) / across;
        const float2 off = inside - 0.5f;
        if (!(dot(off, off) < least))
            continue;
        const int column = min((int)((x + inside.x) / columns * real.width), real.width - 1);
        const int row = min((int)((y + inside.y) / rows * real.height), real.height - 1);
        if (is_thin(real, column, row, x, y, columns, rows)) {
            nearest = (int2)(column, row);
            least = dot(off, off);
        }
    }
    return nearest;
}

// Return the surface of an entry: its tangent plane, 0 if there is none. `v` gets its direction. x and y
// count cells; rows of second surfaces follow below.
static inline float4 entry_plane(Texels real, int x, int y, int columns, int rows, float3 *v)
{
    *v = texel_direction(x, y % rows, columns, rows);
    if (y < rows)
        return plane_at(real, x + 0.5f, y + 0.5f, columns, rows);
    const int2 texel = thin_texel(real, x, y - rows, columns, rows);
    if (texel.x < 0)
        return (float4)(0.0f);
    *v = texel_direction(texel.x, texel.y, real.width, real.height);
    return texel_plane(real, texel.x, texel.y);
}

__kernel void place_cells(
    const int columns,
    const int rows,
    const int first,                       // row of entries
    const int first_column,
    const int real_width,
    const int real_height,
    __global const float4 *restrict real_surface,
    const float kept,                      // most samples that means count as from now on
    __global float4 *restrict plane,       // in, out
    __global float4 *restrict mean,        // in, out
    __global float4 *restrict smooth,      // in, out
    __global float4 *restrict point)       // out
{
    const int x = first_column + get_global_id(0), y = first + get_global_id(1);
    if (x >= columns || y >= CACHE_SURFACES * rows)
        return;
    const int cell = y * columns + x;
    float3 v;
    float4 now = entry_plane((Texels){real_width, real_height, real_surface}, x, y, columns, rows, &v);
    const float4 before = plane[cell];
    const int same = same_surface(now, before);
    const float samples = mean[cell].w, left = same ? fmin(samples, kept) : 0.0f;
    if (now.w > 0.0f && before.w > 0.0f)
        now.w = forgotten(before.w, samples - left);
    mean[cell].w = left;
    smooth[cell].w = same ? smooth[cell].w : 0.0f;
    plane[cell] = now;
    point[cell] = (float4)(v / fmax(dot(now.xyz, v), 1e-30f), 0.0f);
}

__kernel void move_cells(
    const int columns,
    const int rows,
    const int real_width,
    const int real_height,
    __global const float4 *restrict real_surface,
    const float kept,                              // most samples that means count as
    __global const float *restrict camera,         // lib/gbuffer/camera.h
    __global const float4 *restrict plane_before,
    __global const float4 *restrict mean_before,
    __global const float4 *restrict smooth_before,
    __global float4 *restrict plane,               // out
    __global float4 *restrict mean,                // out
    __global float4 *restrict smooth,              // out
    __global float4 *restrict point)               // out
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= columns || y >= CACHE_SURFACES * rows)
        return;
    const int cell = y * columns + x;
    float3 v;
    float4 now = entry_plane((Texels){real_width, real_height, real_surface}, x, y, columns, rows, &v);
    float4 mean_now = (float4)(0.0f), smooth_now = (float4)(0.0f);
    float3 mean_flux = (float3)(0.0f), smooth_flux = (float3)(0.0f);
    const int entries = CACHE_SURFACES * columns * rows;
    if (now.w > 0.0f) {
        const float3 p = camera_before(camera, v, dot(now.xyz, v));
        const float3 there = p / fmax(dot(now.xyz, v), 1e-30f);
        const float3 normal = camera_before(camera, -normalize(now.xyz), 0.0f);
        float2 past;
        const int2 corner = cache_corner(columns, rows, there, &past);
        float drawn = 0.0f;
        for (int k = 0; k < 4 * CACHE_SURFACES; k++) {
            const int i = k & 3;
            const int from = cache_cell(columns, rows, corner.x + (i & 1), corner.y + (i >> 1))
                + (k >> 2) * columns * rows;
            const float4 before = plane_before[from], known = mean_before[from];
            const float weight = (i & 1 ? past.x : 1.0f - past.x)
                * (i & 2 ? past.y : 1.0f - past.y) * cache_agreement(before, there, normal);
            // Weighted by samples; sums first, means after.
            mean_now += weight * (float4)(known.w * known.xyz, known.w);
            const float4 shown = smooth_before[from];
            smooth_now += weight * (float4)(shown.w * shown.xyz, shown.w);
            mean_flux += weight * known.w * mean_before[entries + from].xyz;
            smooth_flux += weight * shown.w * smooth_before[entries + from].xyz;
            drawn = fmax(drawn, before.w - 1.0f + known.w);
        }
        const float left = fmin(floor(mean_now.w), kept);
        mean_flux = camera_now(camera, mean_flux / fmax(mean_now.w, 1e-30f));
        smooth_flux = camera_now(camera, smooth_flux / fmax(smooth_now.w, 1e-30f));
        mean_now = left >= 1.0f ? (float4)(mean_now.xyz / mean_now.w, left) : (float4)(0.0f);
        smooth_now.xyz /= fmax(smooth_now.w, 1e-30f);
        now.w = forgotten(1.0f, ceil(drawn) - left);
    }
    mean[cell] = mean_now;
    smooth[cell] = smooth_now;
    mean[entries + cell].xyz = mean_flux;
    smooth[entries + cell].xyz = smooth_flux;
    plane[cell] = now;
    point[cell] = (float4)(v / fmax(dot(now.xyz, v), 1e-30f), 0.0f);
}

__kernel void list_cells(
    const int width,
    const int height,
    __global const int *restrict list,
    __global const int *restrict count,
    __global const float *restrict guide,
    __global const float *restrict touched,
    __global const float4 *restrict boxes,
    const int box_count,
    const float min_solid_angle,                     // least solid angle of objects that matter, sr
    const int columns,
    const int rows,
    const float first,                     // samples per cell where objects have no influence yet
    const float enough,                    // samples after which a cell is not refined further
    __global const float4 *restrict plane,
    __global const float4 *restrict mean,
    __global int *restrict listed,         // in, out: 1 at the cells of the list
    __global int *restrict cells,          // out
    __global int *restrict cell_count,     // in, out: length of the list, 0 at the start
    __global int *restrict next_count,      // out: 0, the next frame's length
    const Work work)
{
    if (get_global_id(0) == 0)
        next_count[0] = 0;
    LIST_ITEM(count[0]);
    COUNT_ITEM;
    const int pixel = plane_index(list[item] % width, list[item] / width, width);
    const int size = plane_size(width, height);
    const float3 p = load_planes(guide + 3 * size, size, pixel), n = load_planes(guide, size, pixel);
    const BoxView seen = view_boxes(boxes, box_count, p, n);
    if (!boxes_matter(seen, min_solid_angle))
        return;
    const float samples = touched[pixel] > 0.0f ? enough : fmin(first, enough);
    float2 past;
    const int2 corner = cache_corner(columns, rows, p, &past);
    for (int k = 0; k < 4 * CACHE_SURFACES; k++) {
        const int i = k & 3, is_second = k >> 2;
        const int cell = cache_cell(columns, rows, corner.x + (i & 1), corner.y + (i >> 1))
            + is_second * columns * rows;
        const float4 surface = plane[cell];
        if (surface.w > 0.0f && mean[cell].w < samples
            && (!is_second || cache_agreement(surface, p, n) > 0.0f)
            && atomic_xchg(listed + cell, 1) == 0)
            cells[atomic_inc(cell_count)] = cell;
    }
}

TRACING_KERNEL void refine_cells(
    const int rays,                        // per cell and frame; twice for unknown cells
    const int entries,                     // CACHE_SURFACES * columns * rows
    const int seed,
    __global const int *restrict list,
    __global const int *restrict count,
    __global const float4 *restrict plane,
    __global const float4 *restrict point,
    const World world,
    __global float4 *restrict mean,         // in, out
    const Work work)
{
    LIST_ITEM(count[0]);
    COUNT_ITEM;
    const int cell = list[item];
    const float3 n = -normalize(plane[cell].xyz);
    const float3 o = real_start(world.real, point[cell].xyz, n);
    const Frame frame = build_frame(n);
    const float4 before = mean[cell];
    const uint first = (uint)(before.w + (plane[cell].w - 1.0f) + 0.5f);
    const int more = before.w < 1.0f ? 2 * rays : rays;
    const uint stream = hash_combine(hash_combine((uint)cell, 0x69727261u), (uint)seed);

    float3 sum = (float3)(0.0f), flux = (float3)(0.0f);
    for (int ray = 0; ray < more; ray++) {
        const float2 u = sobol_2d(first + ray, stream);
        Scatter s = no_scatter(n);
        s.light_share = lights_shine(world.lights) ? 0.5f : 0.0f;
        if (sobol_1d(first + ray, hash_combine(stream, 1)) < s.light_share) {
            const float3 light = sample_light(world.lights, u);
            s.texel = texel_towards(world.real, light);
            s.wi = towards_light(world.real, light, s.texel, o);
        } else
        {
            s.wi = frame_to_world(frame, sample_cosine(u));
        }
        const float cosine = dot(n, s.wi);
        if (!(cosine > 0.0f))
            continue;
        s.density = (1.0f - s.light_share) * cosine / IPRT_PI;
        const RealHit hit = trace_real_layer(world.real, o, s.wi, INFINITY);
        const float share = inverse_density(world, s, hit) * cosine / IPRT_PI;
        if (!(share > 0.0f))
            continue;
        const float3 light = share * captured_radiance(world.real, hit, s.wi);
        sum += light;
        flux += luminance(light) / fmax(cosine, LEAST_COSINE) * s.wi;
    }
    const float total = before.w + more;
    mean[cell] = (float4)((before.xyz * before.w + sum) / total, total);
    mean[entries + cell].xyz = (mean[entries + cell].xyz * before.w + flux) / total;
}

__kernel void smooth_cells(
    __global const int *restrict list,
    __global const int *restrict count,
    const int columns,
    const int rows,
    __global const float4 *restrict plane,
    __global const float4 *restrict point,
    __global const float4 *restrict mean,
    __global int *restrict listed,         // out: 0
    __global float4 *restrict smooth,       // out
    const Work work)
{
    LIST_ITEM(count[0]);
    COUNT_ITEM;
    const int cell = list[item], x = cell % columns, y = cell / columns % rows;
    listed[cell] = 0;
    const float3 n = -normalize(plane[cell].xyz), p = point[cell].xyz;
    const float4 own = mean[cell];
    const float share = OWN_SAMPLES / (OWN_SAMPLES + own.w);
    const int entries = CACHE_SURFACES * columns * rows;
    float3 sum = own.w * own.xyz, flux = own.w * mean[entries + cell].xyz;
    float weights = own.w;
    for (int dy = -SMOOTH_RADIUS; dy <= SMOOTH_RADIUS; dy++)
        for (int dx = -SMOOTH_RADIUS; dx <= SMOOTH_RADIUS; dx++) {
            const int first = cache_cell(columns, rows, x + dx, y + dy);
            for (int i = 0; i < CACHE_SURFACES; i++) {
                const int other = first + i * columns * rows;
                const float4 value = mean[other];
                if (other == cell || !(value.w > 0.0f))
                    continue;
                const float weight = share * value.w * cache_agreement(plane[other], p, n)
                    / (1.0f + dx * dx + dy * dy);
                sum += weight * value.xyz;
                flux += weight * mean[entries + other].xyz;
                weights += weight;
            }
        }
    smooth[entries + cell] = (float4)(flux / fmax(weights, 1e-30f), 0.0f);
    smooth[cell] = (float4)(sum / fmax(weights, 1e-30f), own.w);
}

__kernel void show_cells(
    const int width,
    const int height,
    __global const float *restrict guide,
    const IrradianceCache cache,
    __global float *restrict shown)        // out: 3 planes
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int pixel = plane_index(x, y, width), size = plane_size(width, height);
    if (guide[6 * size + pixel] > 0.0f)
        store_planes(shown, size, pixel,
                     cached_irradiance(cache, load_planes(guide + 3 * size, size, pixel),
                                       load_planes(guide, size, pixel)));
}
