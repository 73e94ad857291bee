// The visible object layer with one pixel per block of pixels of the view: the covered pixel nearest to the
// block's centre, so that no object is lost, however thin.
//
// Planes are as in compositing/unpack.cl; full_*: of the view, the others: of the blocks. The distance is
// along the ray through the block's centre, to the pixel's tangent plane. Motion is in pixels of each.
#include "gbuffer/planes.h"
#include "gbuffer/view.h"

// Largest relative change of distance: unbounded for a plane seen edge-on.
#define PLANE_RANGE 0.03f

// Return the first column (or row) whose centre lies in the block or beyond.
static inline int first_pixel(int block, float scale, float offset)
{
    // Centres on the border belong to the block that starts there, despite rounding.
    return (int)ceil((block - offset) / scale - 0.5f - 1e-3f);
}

__kernel void reduce_objects(
    const int width,
    const int height,
    const int full_width,
    const int full_height,
    const float4 to_block, // image point p of the view: p * to_block.xy + to_block.zw of the blocks
    __global const float *restrict view,          // of the blocks
    __global const float *restrict full_view,
    __global const float *restrict full_normal,
    __global const float *restrict full_depth,
    __global const float *restrict full_id,
    __global const float *restrict full_variant,  // null without variants
    __global const float *restrict full_roughness,
    __global const float *restrict full_metallic, // null without principled materials
    __global const float *restrict full_albedo,
    __global const float *restrict full_coverage,
    __global const float *restrict full_motion,
    __global float *restrict normal,
    __global float *restrict depth,
    __global float *restrict id,
    __global float *restrict variant,
    __global float *restrict roughness,
    __global float *restrict metallic,
    __global float *restrict albedo,
    __global float *restrict coverage,
    __global float *restrict motion)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int size = plane_size(width, height), p = plane_index(x, y, width);
    const int full_size = plane_size(full_width, full_height);
    const int x0 = max(first_pixel(x, to_block.s0, to_block.s2), 0);
    const int x1 = min(first_pixel(x + 1, to_block.s0, to_block.s2), full_width);
    const int y0 = max(first_pixel(y, to_block.s1, to_block.s3), 0);
    const int y1 = min(first_pixel(y + 1, to_block.s1, to_block.s3), full_height);
    const float2 centre = ((float2)(x + 0.5f, y + 0.5f) - to_block.zw) / to_block.xy;
    int chosen = -1, chosen_x = 0, chosen_y = 0;
    float least = INFINITY;
    for (int j = y0; j < y1; j++)
        for (int i = x0; i < x1; i++) {
            const int q = plane_index(i, j, full_width);
            const float dx = i + 0.5f - centre.x, dy = j + 0.5f - centre.y;
            const float distance = dx * dx + dy * dy;
            if (full_coverage[q] > 0.0f && distance < least) {
                least = distance;
                chosen = q;
                chosen_x = i;
                chosen_y = j;
            }
        }
    if (chosen < 0) {
        store_planes(normal, size, p, (float3)(0.0f));
        depth[p] = id[p] = coverage[p] = 0.0f;
        motion[p] = motion[size + p] = -1e9f;
        return;
    }
    const float3 n = load_planes(full_normal, full_size, chosen);
    const float3 seen = view_direction(full_view, (float2)(chosen_x + 0.5f, chosen_y + 0.5f));
    const float3 v = view_direction(view, (float2)(x + 0.5f, y + 0.5f));
    const float nearer = dot(n, seen) / fmin(dot(n, v), -1e-6f);
    store_planes(normal, size, p, n);
    depth[p] = full_depth[chosen] * clamp(nearer, 1.0f - PLANE_RANGE, 1.0f + PLANE_RANGE);
    id[p] = full_id[chosen];
    if (variant)
        variant[p] = full_variant[chosen];
    roughness[p] = full_roughness[chosen];
    if (metallic)
        metallic[p] = full_metallic[chosen];
    store_planes(albedo, size, p, load_planes(full_albedo, full_size, chosen));
    coverage[p] = full_coverage[chosen];
    // The block's centre moved with the pixel.
    const float2 before = (float2)(full_motion[chosen], full_motion[full_size + chosen]);
    const int known = before.x > -1e8f;
    const float2 moved = (before - (float2)(chosen_x + 0.5f, chosen_y + 0.5f)) * to_block.xy;
    motion[p] = known ? x + 0.5f + moved.x : -1e9f;
    motion[size + p] = known ? y + 0.5f + moved.y : -1e9f;
}
