// Light that was computed for blocks of pixels, for each pixel of the view (joint bilateral
// upsampling): blended between the four nearest blocks, as far as their surface continues the pixel's.
//
//   in   normal (3 planes), depth, id (1 plane each; 0: nothing to light) of a layer of the view, and
//        the same of the blocks; block_light: 3 planes, or with -DRATIO float4 per block, no border
//   out  light: the same of the view; 0, with -DRATIO 1, where the id is 0, or blocks that differ have
//        no surface
#include "gbuffer/guide.h"
#include "gbuffer/view.h"

// Where no block's surface continues the pixel's, one of the same id serves, or else any surface.
#define SAME_ID 1e-4f
#define ANY 1e-8f
// Ratios that differ by less, and lights that differ by less of their size, are blended without a
// look at the surfaces.
#define ALIKE 0.004f

#ifdef RATIO
#define LIGHT float4
#else
#define LIGHT float
#endif

// Column and row of a block around an image point: to the right of the `corner` for odd i, below it
// from 2 on.
static inline int2 block_at(float2 corner, int i, int width, int height)
{
    const int column = (int)corner.x + (i & 1), row = clamp((int)corner.y + (i >> 1), 0, height - 1);
#ifdef VIEW_EQUIRECT
    return (int2)(wrap_column(column, width), row);
#else
    return (int2)(clamp(column, 0, width - 1), row);
#endif
}

// Light of a block, less what leaves the pixel as it is.
static inline float3 light_of(__global const LIGHT *restrict light, int2 block, int width, int height)
{
#ifdef RATIO
    return light[block.y * width + block.x].xyz - 1.0f;
#else
    return load_planes(light, plane_size(width, height), plane_index(block.x, block.y, width));
#endif
}

// The surface that a pixel shows: points x with dot(normal, x) = plane; and how quickly likeness falls.
typedef struct {
    float3 normal;
    float plane;
    float range; // of the pixel's point, metres
    float id;
    float normal_sharpness;
    float plane_sharpness;
} Surface;

// How far the surface of a block continues another one.
static inline float likeness(
    const Surface surface, __global const float *restrict view,
    __global const float *restrict normal, __global const float *restrict depth,
    __global const float *restrict id, int2 block, int width, int height)
{
    const int size = plane_size(width, height), q = plane_index(block.x, block.y, width);
    const float3 w = view_direction(view, (float2)(block.x + 0.5f, block.y + 0.5f));
    const float cosine = dot(surface.normal, load_planes(normal, size, q));
    const float off = fabs(depth[q] * dot(surface.normal, w) - surface.plane) / surface.range;
    const float turn = fmax(1.0f - cosine, 0.0f);
    const float like = falloff(surface.normal_sharpness * turn + surface.plane_sharpness * off);
    return id[q] == surface.id ? like + SAME_ID : id[q] > 0.0f ? ANY : 0.0f;
}

__kernel void enlarge(
    __global const float *restrict view,
    __global const float *restrict block_view,
    const float4 to_block, // image point p of the view: p * to_block.xy + to_block.zw of the blocks
    const int width,
    const int height,
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
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int size = plane_size(width, height), p = plane_index(x, y, width);
    float3 blended = (float3)(0.0f);
    if (id[p] > 0.0f) {
        const float2 at = (float2)(x + 0.5f, y + 0.5f) * to_block.xy + to_block.zw - 0.5f;
        const float2 corner = floor(at), f = at - corner;
        // Where the blocks agree, as most do in most views, there is nothing to choose.
        float3 most = (float3)(-INFINITY), least = (float3)(INFINITY);
        for (int i = 0; i < 4; i++) {
            const float3 one = light_of(block_light, block_at(corner, i, block_width, block_height),
                                        block_width, block_height);
            most = fmax(most, one);
            least = fmin(least, one);
        }
        const float3 apart = most - least, size_of = fmax(most, -least);
#ifdef RATIO
        const float limit = ALIKE;
#else
        const float limit = ALIKE * fmax(size_of.x, fmax(size_of.y, size_of.z));
#endif
        const int differ = fmax(apart.x, fmax(apart.y, apart.z)) > limit;
        Surface own = {(float3)(0.0f), 0.0f, depth[p], id[p], normal_sharpness, plane_sharpness};
        if (differ) {
            own.normal = load_planes(normal, size, p);
            own.plane = own.range
                * dot(own.normal, view_direction(view, (float2)(x + 0.5f, y + 0.5f)));
        }
        float sum = 0.0f;
        TAP_LOOP
        for (int i = 0; i < 4; i++) {
            const int2 block = block_at(corner, i, block_width, block_height);
            float weight = (i & 1 ? f.x : 1.0f - f.x) * (i & 2 ? f.y : 1.0f - f.y);
            if (differ)
                weight *= likeness(own, block_view, block_normal, block_depth, block_id, block,
                                   block_width, block_height);
            sum += weight;
            blended += weight * light_of(block_light, block, block_width, block_height);
        }
        blended = sum > 0.0f ? blended / sum : (float3)(0.0f);
    }
#ifdef RATIO
    // Exactly 1 where nothing changes.
    light[y * width + x] = (float4)(1.0f + blended, 1.0f);
#else
    store_planes(light, size, p, blended);
#endif
}
