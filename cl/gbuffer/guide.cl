// Guide: gathers what the image-space passes compare pixels by into the seven planes of guide.h,
// and keeps borders wrapped around the seam of equirect views.
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top. World: +Y up, metres,
// origin at the capture centre.
//
//   kernel        in                                           out
//   build_guide   normal (3), depth (1, m, 0 = nothing),       guide (7); id 0 without depth
//                 id (1, 0 = nothing to trace)
//   wrap_border   any stack of planes                          its left and right border
//
// No work-group contract. Build with -DVIEW_EQUIRECT for equirect views (wrap_border needs it).
#include "gbuffer/guide.h"
#include "gbuffer/view.h"

__kernel void build_guide(
    __global const float *restrict view,   // projection and rotation, view.h
    __global const float *restrict normal, // world-space unit normals, 3 planes
    __global const float *restrict depth,  // radial distance in metres, 0 = nothing here
    __global const float *restrict id,     // 0 = nothing to trace, else the surface's id
    __global float *restrict guide,        // out: 7 planes
    int width,
    int height)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int size = plane_size(width, height), p = plane_index(x, y, width);
    float3 position = depth[p] * view_direction(view, (float2)(x + 0.5f, y + 0.5f));
    for (int c = 0; c < 3; c++)
        guide[(GUIDE_NORMAL + c) * size + p] = normal[c * size + p];
    guide[(GUIDE_POSITION + 0) * size + p] = position.x;
    guide[(GUIDE_POSITION + 1) * size + p] = position.y;
    guide[(GUIDE_POSITION + 2) * size + p] = position.z;
    guide[GUIDE_ID * size + p] = depth[p] > 0.0f ? fmax(id[p], 0.0f) : 0.0f;
}

__kernel void wrap_border(
    __global float *restrict planes, // in, out: `channels` planes; work item y = channel, row
    int channels,
    int width,
    int height)
{
    int i = get_global_id(0), channel = get_global_id(1) / height, y = get_global_id(1) % height;
    if (i >= 2 * PLANE_PAD || channel >= channels)
        return;
    int x = i < PLANE_PAD ? i - PLANE_PAD : width + i - PLANE_PAD;
    __global float *plane = planes + channel * plane_size(width, height);
    plane[plane_index(x, y, width)] = plane[plane_index(wrap_column(x, width), y, width)];
}
