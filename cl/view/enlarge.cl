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
// Ratios that differ by less are blended without a look at the surfaces.
#define ALIKE 0.004f

// Lights that differ by less of their size are blended without a look at the surfaces.
#define ALIKE 0.004f

#ifdef RATIO
#define LIGHT float4
#else
#define LIGHT float
#endif

// Light of the block at `q`, `i` without border, less what leaves the pixel as it is.
static inline float3 light_of(__global const LIGHT *restrict light, int size, int q, int i)
{
#ifdef RATIO
    return light[i].xyz - 1.0f;
#else
    return load_planes(light, size, q);
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
    __global const float *restrict id, int size, int q, int column, int row)
{
    const float3 w = view_direction(view, (float2)(column + 0.5f, row + 0.5f));
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
        const int blocks = plane_size(block_width, block_height);
        const float2 at = (float2)(x + 0.5f, y + 0.5f) * to_block.xy + to_block.zw - 0.5f;
        const float2 corner = floor(at), f = at - corner;
        const int top = clamp((int)corner.y, 0, block_height - 1);
        const int bottom = clamp((int)corner.y + 1, 0, block_height - 1);
#ifdef VIEW_EQUIRECT
        const int left = wrap_column((int)corner.x, block_width);
        const int right = wrap_column((int)corner.x + 1, block_width);
#else
        const int left = clamp((int)corner.x, 0, block_width - 1);
        const int right = clamp((int)corner.x + 1, 0, block_width - 1);
#endif
        const int a = plane_index(left, top, block_width);
        const int b = plane_index(right, top, block_width);
        const int c = plane_index(left, bottom, block_width);
        const int d = plane_index(right, bottom, block_width);
        const int above = top * block_width, below = bottom * block_width;
        const float3 light_a = light_of(block_light, blocks, a, above + left);
        const float3 light_b = light_of(block_light, blocks, b, above + right);
        const float3 light_c = light_of(block_light, blocks, c, below + left);
        const float3 light_d = light_of(block_light, blocks, d, below + right);
        float4 weight = (float4)((1.0f - f.x) * (1.0f - f.y), f.x * (1.0f - f.y),
                                 (1.0f - f.x) * f.y, f.x * f.y);
        // Where the blocks agree, as most do in most views, there is nothing to choose.
        const float3 most = fmax(fmax(light_a, light_b), fmax(light_c, light_d));
        const float3 least = fmin(fmin(light_a, light_b), fmin(light_c, light_d));
        const float3 apart = most - least, size_of = fmax(most, -least);
#ifdef RATIO
        const float limit = ALIKE;
#else
        const float limit = ALIKE * fmax(size_of.x, fmax(size_of.y, size_of.z));
#endif
        if (fmax(apart.x, fmax(apart.y, apart.z)) > limit) {
            const float3 n = load_planes(normal, size, p);
            const float range = depth[p];
            const float3 v = view_direction(view, (float2)(x + 0.5f, y + 0.5f));
            const Surface own
                = {n, range * dot(n, v), range, id[p], normal_sharpness, plane_sharpness};
#define LIKENESS(q, column, row)                                                                   \
    likeness(own, block_view, block_normal, block_depth, block_id, blocks, q, column, row)
            weight *= (float4)(LIKENESS(a, left, top), LIKENESS(b, right, top),
                               LIKENESS(c, left, bottom), LIKENESS(d, right, bottom));
        }
        const float sum = weight.x + weight.y + weight.z + weight.w;
        blended = weight.x * light_a + weight.y * light_b + weight.z * light_c + weight.w * light_d;
        blended = sum > 0.0f ? blended / sum : (float3)(0.0f);
    }
#ifdef RATIO
    // Exactly 1 where nothing changes.
    light[y * width + x] = (float4)(1.0f + blended, 1.0f);
#else
    store_planes(light, size, p, blended);
#endif
}
