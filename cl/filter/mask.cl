// Sparse tracing mask (IPRT Eqs. 3 and 4): how densely each pixel is traced, and which pixels get
// a ray in this frame.
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top.
//
//   kernel            in                                          out
//   reproject_touched touched (1 plane: frames for which an       touched at this frame's pixels
//                     object's influence is remembered, 0 none)
//   choose_level      guide (7 planes), touched (1 plane, border  level (1 plane of uchar: 0, 1, 2;
//                     wrapped)                                    255 = nothing to trace)
//   list_traced       level, touched                              list of y * width + x and its
//                                                                 length; touched less one frame
//
// list_traced runs over CHUNK pixels of a row per work item: one atomic per chunk, and rays that
// are neighbours in the list are neighbours in the picture. Its order differs between runs.
#include "gbuffer/guide.h"

#define CHUNK 64

__kernel void reproject_touched(
    __global const float *restrict motion,   // previous pixel position, 2 planes; -1e9 = nowhere
    __global const float *restrict previous, // 1 plane
    __global float *restrict touched,        // out: 1 plane
    int width,
    int height)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int p = plane_index(x, y, width);
    float mx = motion[p], my = motion[plane_size(width, height) + p];
    float left = 0.0f;
    if (fabs(mx) < 1e6f && my >= 0.0f && my < height) {
        int column = wrap_column((int)floor(mx), width);
        if (column >= 0 && column < width)
            left = previous[plane_index(column, (int)my, width)];
    }
    touched[p] = left;
}

__kernel void choose_level(
    __global const float *restrict guide,   // 7 planes
    __global const float *restrict touched, // 1 plane
    __global uchar *restrict level,         // out: 1 plane
    float sigma_position,                   // sigma_p, per unit of the positions
    float low,                              // delta_1
    float high,                             // delta_2; 0 traces every pixel
    float faint_frames,                     // touched for no longer: one ray for 4 pixels will do
    int width,
    int height)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int size = plane_size(width, height), stride = plane_stride(width);
    int p = plane_index(x, y, width);
    float nx = guide[p], ny = guide[size + p], nz = guide[2 * size + p];
    float px = guide[3 * size + p], py = guide[4 * size + p], pz = guide[5 * size + p];
    float id = guide[6 * size + p];

    float turn = 0.0f, apart = 0.0f, active = 0.0f;
    #pragma unroll
    for (int dy = -2; dy <= 2; dy++) {
        #pragma unroll
        for (int dx = -2; dx <= 2; dx++) {
            int q = p + dx + dy * stride;
            float ax = guide[q] - nx, ay = guide[size + q] - ny, az = guide[2 * size + q] - nz;
            float bx = guide[3 * size + q] - px, by = guide[4 * size + q] - py;
            float bz = guide[5 * size + q] - pz;
            // Another surface, or none, counts as a difference of 1; outside the picture as 0.
            bool inside = guide[6 * size + q] >= 0.0f, same = guide[6 * size + q] == id;
            turn = fmax(turn, same ? ax * ax + ay * ay + az * az : inside ? 1.0f : 0.0f);
            apart = fmax(apart, same ? bx * bx + by * by + bz * bz : 0.0f);
            if (abs(dx) <= 1 && abs(dy) <= 1 && inside)
                active = fmax(active, touched[q]);
        }
    }
    float squared = fmax(turn, sigma_position * sigma_position * apart);
    // Where influence is graded, edges are worth rays only where objects change something.
    squared = active > faint_frames ? 1.0f
        : active > 0.0f || faint_frames == 0.0f ? fmin(squared, 1.0f) : 0.0f;
    int chosen = squared >= high * high ? 0 : squared >= low * low || active > 0.0f ? 1 : 2;
    level[p] = id > 0.0f ? chosen : LEVEL_NONE;
}

__kernel void list_traced(
    __global const uchar *restrict level, // 1 plane
    __global float *restrict touched,     // in, out: 1 plane, counted down by a frame
    __global int *restrict list,          // out: pixels that get a ray
    __global int *restrict count,         // in, out: length of the list, 0 at the start
    int offset_x,                         // the grid's origin in this frame
    int offset_y,
    int width,
    int height)
{
    int x0 = get_global_id(0) * CHUNK, y = get_global_id(1);
    if (x0 >= width || y >= height)
        return;
    int x1 = min(x0 + CHUNK, width);
    int traced = 0;
    for (int x = x0; x < x1; x++) {
        int p = plane_index(x, y, width);
        traced += is_traced(level[p], x - offset_x, y - offset_y);
        touched[p] = fmax(touched[p] - 1.0f, 0.0f);
    }
    int next = traced > 0 ? atomic_add(count, traced) : 0;
    for (int x = x0; x < x1; x++)
        if (is_traced(level[plane_index(x, y, width)], x - offset_x, y - offset_y))
            list[next++] = y * width + x;
}
