// Joint bilateral upsampling of light computed per block of pixels: blended between the four nearest
// blocks, weighted by how well their surface continues the pixel's.
//
//   in   normal (3 planes), depth, id (1 plane each; 0: nothing to light) of a layer of the view, and
//        the same of the blocks; block_light: 3 planes, or with -DRATIO float4 per block, no border
//   out  light: the same of the view; 0, with -DRATIO 1, where the id is 0, or where the blocks differ
//        and have no surface
//
// With -DWIDE a work item takes all pixels between the centres of the same four blocks, tile by tile, so
// that these blocks are examined once. Otherwise it takes one pixel, a tile of its own.
#include "gbuffer/guide.h"
#include "gbuffer/view.h"
#include "maths/lanes.h"

// Weights of blocks with the same id, and of any block, where no block's surface continues the pixel's.
#define SAME_ID 1e-4f
#define ANY 1e-8f
// Ratios with a smaller difference, and lights with a smaller relative difference, are blended without
// comparing surfaces.
#define ALIKE 0.004f

#ifdef RATIO
#define LIGHT float4
#else
#define LIGHT float
#endif

// Shape of a tile in pixels, the elements of vectors, row by row; and their columns and rows.
#ifdef WIDE
#define TILE 4
#define COLUMNS (float16)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3)
#define ROWS (float16)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3)
#define ANY_OF(CHOSEN) any(CHOSEN)
#else
#define TILE 1
#define COLUMNS 0.0f
#define ROWS 0.0f
#define ANY_OF(CHOSEN) (CHOSEN)
#endif

// Return the tile of a plane whose first pixel is p.
static inline floats load_tile(__global const float *restrict plane, int p, int stride)
{
#ifdef WIDE
    return (float16)(vload4(0, plane + p), vload4(0, plane + p + stride),
                     vload4(0, plane + p + 2 * stride), vload4(0, plane + p + 3 * stride));
#else
    return plane[p];
#endif
}

static inline void store_tile(
    floats values, __global float *restrict plane, int p, int stride, int columns, int rows)
{
#ifdef WIDE
    if (columns >= TILE && rows >= TILE) {
        vstore4(values.s0123, 0, plane + p);
        vstore4(values.s4567, 0, plane + p + stride);
        vstore4(values.s89ab, 0, plane + p + 2 * stride);
        vstore4(values.scdef, 0, plane + p + 3 * stride);
        return;
    }
#endif
    for (int j = 0; j < min(rows, TILE); j++)
        for (int i = 0; i < min(columns, TILE); i++)
            plane[p + j * stride + i] = lane(&values, j * TILE + i);
}

// Return the column and row of a block around an image point: right of `corner` for odd i, below it from
// i = 2 on.
static inline int2 block_at(int2 corner, int i, int width, int height, int seam)
{
    const int column = corner.x + (i & 1), row = clamp(corner.y + (i >> 1), 0, height - 1);
    return (int2)(clamp(wrap_column(column, width, seam), 0, width - 1), row);
}

// Return a block's light minus the value that leaves the pixel unchanged.
static inline float3 light_of(__global const LIGHT *restrict light, int2 block, int width, int height)
{
#ifdef RATIO
    return light[block.y * width + block.x].xyz - 1.0f;
#else
    return load_planes(light, plane_size(width, height), plane_index(block.x, block.y, width));
#endif
}

// Return whether the blocks differ enough that a pixel must choose between them.
static inline int blocks_differ(
    __global const LIGHT *restrict light, int2 corner, int width, int height, int seam)
{
    float3 most = (float3)(-INFINITY), least = (float3)(INFINITY);
    for (int i = 0; i < 4; i++) {
        const int2 block = block_at(corner, i, width, height, seam);
        const float3 one = light_of(light, block, width, height);
        most = fmax(most, one);
        least = fmin(least, one);
    }
    const float3 apart = most - least, size_of = fmax(most, -least);
#ifdef RATIO
    const float limit = ALIKE;
#else
    const float limit = ALIKE * fmax(size_of.x, fmax(size_of.y, size_of.z));
#endif
    return fmax(apart.x, fmax(apart.y, apart.z)) > limit;
}

// The surfaces of a tile: points x with dot(normal, x) = plane, and the falloff of likeness.
typedef struct {
    floats x, y, z;             // normal, world
    floats right, up, back;     // the same in view space
    floats plane;
    floats id;
    floats plane_sharpness;     // per metre
    float normal_sharpness;
} Surfaces;

// Compute the unit directions through the image points (x, y), in view space: view_local_direction.
static inline void local_directions(
    __global const float *restrict view, floats x, floats y, floats *right, floats *up, floats *back)
{
    if (is_equirect(view)) {
        const floats azimuth = (x / view[12] - 0.5f) * (2.0f * IPRT_PI);
        const floats polar = y / view[13] * IPRT_PI;
        *right = sin(polar) * sin(azimuth);
        *up = cos(polar);
        *back = -sin(polar) * cos(azimuth);
        return;
    }
    const floats across = x - view[10], upwards = view[11] - y;
    const floats inverse = 1.0f / sqrt(across * across + upwards * upwards + view[9] * view[9]);
    *right = across * inverse;
    *up = upwards * inverse;
    *back = -view[9] * inverse;
}

// Return how well a block's surface continues the surfaces of a tile.
static inline floats likeness(
    const Surfaces own, __global const float *restrict view, __global const float *restrict normal,
    __global const float *restrict depth, __global const float *restrict id, int2 block, int width,
    int height)
{
    const int size = plane_size(width, height), q = plane_index(block.x, block.y, width);
    const float3 n = load_planes(normal, size, q);
    const float3 w = view_local_direction(view, (float2)(block.x + 0.5f, block.y + 0.5f));
    const float right = depth[q] * w.x, up = depth[q] * w.y, back = depth[q] * w.z;
    const floats cosine = own.x * n.x + own.y * n.y + own.z * n.z;
    const floats off = fabs(own.right * right + own.up * up + own.back * back - own.plane);
    const floats x = own.normal_sharpness * fmax(1.0f - cosine, 0.0f) + own.plane_sharpness * off;
    // falloff() of lib/maths/maths.h
    floats like = either(x < 8.0f, 1.0f - 0.125f * x, 0.0f);
    like *= like;
    like *= like;
    like *= like;
    const float other = id[q] > 0.0f ? ANY : 0.0f;
    return either(own.id == id[q], like + SAME_ID, (floats)(other));
}

// Return the first column (or row) whose centre lies between the centres of a block and the next.
static inline int first_pixel(int block, float scale, float offset)
{
    // Pixels on a block's centre belong to the interval that starts there, despite rounding.
    return (int)ceil((block + 0.5f - offset) / scale - 0.5f - 1e-3f);
}

// Return the fraction of the way from a block's centre to the next one's.
static inline floats way(floats pixel, float scale, float offset, int block)
{
    return clamp((pixel + 0.5f) * scale + (offset - 0.5f - block), 0.0f, 1.0f);
}

__kernel void enlarge(
    __global const float *restrict view,
    __global const float *restrict block_view,
    const float4 to_block, // image point p of the view: p * to_block.xy + to_block.zw of the blocks
    const int width,
    const int height,
    const int seam,
    const int block_width,
    const int block_height,
    const float normal_sharpness, // falloff per 1 - cosine of the normals' angle
    const float plane_sharpness,  // falloff per distance from the pixel's plane / depth
    __global const float *restrict normal,
    __global const float *restrict depth,
    __global const float *restrict id,
    __global const float *restrict block_normal,
    __global const float *restrict block_depth,
    __global const float *restrict block_id,
    __global const LIGHT *restrict block_light,
    __global LIGHT *restrict light)
{
#ifdef WIDE
    const int2 corner = (int2)(get_global_id(0), get_global_id(1)) - 1;
    if (corner.x >= block_width || corner.y >= block_height)
        return;
    const int x0 = max(first_pixel(corner.x, to_block.s0, to_block.s2), 0);
    const int x1 = min(first_pixel(corner.x + 1, to_block.s0, to_block.s2), width);
    const int y0 = max(first_pixel(corner.y, to_block.s1, to_block.s3), 0);
    const int y1 = min(first_pixel(corner.y + 1, to_block.s1, to_block.s3), height);
#else
    const int x0 = get_global_id(0), y0 = get_global_id(1), x1 = x0 + 1, y1 = y0 + 1;
    if (x0 >= width || y0 >= height)
        return;
    const int2 corner = (int2)(floor((x0 + 0.5f) * to_block.s0 + to_block.s2 - 0.5f),
                               floor((y0 + 0.5f) * to_block.s1 + to_block.s3 - 0.5f));
#endif
    const int size = plane_size(width, height), stride = plane_stride(width);
    const int across = max(x1 - x0 + TILE - 1, 0) / TILE, down = max(y1 - y0 + TILE - 1, 0) / TILE;
    for (int tile = 0; tile < across * down; tile++) {
        const int x = x0 + TILE * (tile % across), y = y0 + TILE * (tile / across);
        const int p = plane_index(x, y, width);
        const floats column = x + COLUMNS, row = y + ROWS;
        floats red = 0.0f, green = 0.0f, blue = 0.0f;
        Surfaces own;
        own.id = load_tile(id, p, stride);
        const ints lit = own.id > 0.0f;
        if (ANY_OF(lit)) {
            // The blocks agree in most of most views: nothing to choose.
            const int choose
                = blocks_differ(block_light, corner, block_width, block_height, seam);
            if (choose) {
                own.x = load_tile(normal, p, stride);
                own.y = load_tile(normal, size + p, stride);
                own.z = load_tile(normal, 2 * size + p, stride);
                own.right = view[0] * own.x + view[3] * own.y + view[6] * own.z;
                own.up = view[1] * own.x + view[4] * own.y + view[7] * own.z;
                own.back = view[2] * own.x + view[5] * own.y + view[8] * own.z;
                const floats range = load_tile(depth, p, stride);
                floats right, up, back;
                local_directions(view, column + 0.5f, row + 0.5f, &right, &up, &back);
                own.plane = range * (own.right * right + own.up * up + own.back * back);
                own.plane_sharpness = plane_sharpness / range;
                own.normal_sharpness = normal_sharpness;
            }
            const floats right = way(column, to_block.s0, to_block.s2, corner.x);
            const floats lower = way(row, to_block.s1, to_block.s3, corner.y);
            floats sum = 0.0f;
            TAP_LOOP
            for (int i = 0; i < 4; i++) {
                const int2 block = block_at(corner, i, block_width, block_height, seam);
                const float3 its_light = light_of(block_light, block, block_width, block_height);
                floats weight = (i & 1 ? right : 1.0f - right) * (i & 2 ? lower : 1.0f - lower);
                if (choose)
                    weight *= likeness(own, block_view, block_normal, block_depth, block_id,
                                       block, block_width, block_height);
                sum += weight;
                red += weight * its_light.x;
                green += weight * its_light.y;
                blue += weight * its_light.z;
            }
            const floats part = either(lit & (sum > 0.0f), 1.0f / sum, 0.0f);
            red *= part;
            green *= part;
            blue *= part;
        }
#ifdef RATIO
        for (int j = 0; j < min(y1 - y, TILE); j++)
            for (int i = 0; i < min(x1 - x, TILE); i++) {
                const int k = j * TILE + i;
                // Exactly 1 where nothing changes.
                light[(y + j) * width + x + i] = (float4)(
                    1.0f + lane(&red, k), 1.0f + lane(&green, k), 1.0f + lane(&blue, k), 1.0f);
            }
#else
        store_tile(red, light, p, stride, x1 - x, y1 - y);
        store_tile(green, light + size, p, stride, x1 - x, y1 - y);
        store_tile(blue, light + 2 * size, p, stride, x1 - x, y1 - y);
#endif
    }
}
