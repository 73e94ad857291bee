// Sparse tracing mask (IPRT Eqs. 3 and 4): the tracing density of each pixel, and the pixels that get a ray
// in this frame.
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top.
//
//   kernel            in                                          out
//   carry_touched     guides of this and the last picture,        touched at this picture's surfaces,
//                     motion, touched of the last picture (1      less one; negative where the last
//                     plane: frames for which influence is        one did not show them: unknown
//                     remembered from then on)
//   choose_level      guide (7 planes), motion, touched,          level (1 plane of uchar, guide.h)
//                     length of the history
//   list_traced       level                                       list of y * width + x, its length
//
// list_traced runs over a tile's row per work item: one atomic per row, and neighbouring rays in the list are
// neighbours in the picture. Its order differs between runs.
#include "gbuffer/batch.h"
#include "filter/signal.h"
#include "filter/surface.h"
#include "maths/lanes.h"
#include "trace/rays.h"

// Return the pixel of the last picture that showed this pixel's surface; -1: none.
static inline ALWAYS_INLINE int pixel_before(
    __global const float *restrict motion, int p, int width, int height, int seam)
{
    const float mx = motion[p], my = motion[plane_size(width, height) + p];
    const int known = (fabs(mx) < 1e6f) & (my >= 0.0f) & (my < height);
    const int column = wrap_column((int)floor(known ? mx : 0.0f), width, seam);
    const int inside = known & (column >= 0) & (column < width);
    return inside ? plane_index(column, (int)my, width) : -1;
}

// Write the square of how much the pixels around each of a row differ from it (Eq. 3), from 0 to 1: by their
// normals or, with `sigma` per unit, their positions. A different or missing surface counts as 1, a pixel
// outside the picture as 0. `p`: the first pixel.
static inline ALWAYS_INLINE void unlikeness(
    __global const float *restrict guide, float sigma, int size, int stride, int p, int count,
    float *restrict squared)
{
    float turn[LANES], apart[LANES];
    for (int i = 0; i < count; i++)
        turn[i] = apart[i] = 0.0f;
    for (int tap = 0; tap < 25; tap++) {
        const int there = tap % 5 - 2 + (tap / 5 - 2) * stride;
        LANE_LOOP
        for (int i = 0; i < count; i++) {
            const int at = p + i, q = at + there;
            const float ax = guide[q] - guide[at], ay = guide[size + q] - guide[size + at];
            const float az = guide[2 * size + q] - guide[2 * size + at];
            const float bx = guide[3 * size + q] - guide[3 * size + at];
            const float by = guide[4 * size + q] - guide[4 * size + at];
            const float bz = guide[5 * size + q] - guide[5 * size + at];
            const float of = guide[GUIDE_ID * size + q];
            const int same = of == guide[GUIDE_ID * size + at];
            const float other = of >= 0.0f ? 1.0f : 0.0f;
            turn[i] = fmax(turn[i], same ? ax * ax + ay * ay + az * az : other);
            apart[i] = fmax(apart[i], same ? bx * bx + by * by + bz * bz : 0.0f);
        }
    }
    for (int i = 0; i < count; i++)
        squared[i] = fmin(fmax(turn[i], sigma * sigma * apart[i]), 1.0f);
}

__kernel void carry_touched(
    PLANES_IN guide[MOST_ENTRIES],               // 7 planes
    PLANES_IN guide_previous[MOST_ENTRIES],      // the last picture's
    PLANES_IN motion[MOST_ENTRIES],              // previous pixel, 2 planes; -1e9 = nowhere
    PLANES_IN before[MOST_ENTRIES],              // 1 plane, touched of the last picture
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    PLANES_OUT touched[MOST_ENTRIES],            // out: 1 plane
    const float unseen[MOST_ENTRIES],            // touched where the last picture did not show it
    float plane_tolerance,                       // distance / depth of one surface; negative: a cut
    float normal_agreement,                      // least cosine between its normals
    int width,
    int height,
    int seam,
    const Camera camera)
{
    TILE_LANES_ITEM;
    const int size = plane_size(width, height);
    LANE_LOOP
    for (int x = first; x < end; x++) {
        const int p = plane_index(x, y, width);
        const Surface surface = surface_before(guide, plane_tolerance, size, p, camera);
        const int q = pixel_before(motion, p, width, height, seam), found = q >= 0, at = found ? q : p;
        const int seen = found & shows_surface(guide_previous, surface, normal_agreement, size, at);
        // What slept has no influence that would need a ray for each pixel at once.
        const int slept = found & (guide_previous[GUIDE_ID * size + at] < 0.0f);
        const float left = fmax(before[at] - 1.0f, 0.0f), new = slept ? -unseen : unseen;
        const float frames = seen ? left : new;
        touched[p] = surface.id > 0.0f ? frames : 0.0f;
    }
    wrap_row(touched, first, end, y, width, seam);
}

__kernel void choose_level(
    PLANES_IN guide[MOST_ENTRIES],               // 7 planes
    PLANES_IN motion[MOST_ENTRIES],              // previous pixel, 2 planes; -1e9 = nowhere
    PLANES_IN touched[MOST_ENTRIES],             // 1 plane, border wrapped
    PLANES_IN certainty[MOST_ENTRIES],           // 2 planes, of the previous histories
    const int keep[MOST_ENTRIES],                // where histories are long, a quarter of the rays
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    __global uchar *restrict level[MOST_ENTRIES], // out: 1 plane
    __global int *restrict count[MOST_ENTRIES],  // out: 0
    float sigma_position[MOST_ENTRIES],          // sigma_p, per unit of the positions
    float low[MOST_ENTRIES],                     // delta_1
    float high[MOST_ENTRIES],                    // delta_2; 0 traces every pixel
    float faint_frames[MOST_ENTRIES],            // touched for at most as long: one ray for 4 pixels
    __global const int *restrict origin,         // x y of the tracing grid in this frame
    int width,
    int height,
    int seam)
{
    if (get_global_id(0) == 0 && get_global_id(1) == 0)
        count[0] = 0;
    TILE_LANES_ITEM;
    const int size = plane_size(width, height), stride = plane_stride(width);
    const int start = plane_index(first, y, width), across = end - first;
    const float at_edges = high > 0.0f ? 1.0f : 0.0f;
    float active[LANES], squared[LANES], unlike[LANES];
    float ask = 0.0f;
    for (int i = 0; i < across; i++)
        active[i] = unlike[i] = 0.0f;
    for (int tap = 0; tap < 9; tap++) {
        const int there = start + tap % 3 - 1 + (tap / 3 - 1) * stride;
        LANE_LOOP
        for (int i = 0; i < across; i++)
            active[i] = fmax(active[i], touched[there + i]);
    }
    for (int i = 0; i < across; i++) {
        const int p = start + i;
        squared[i] = (active[i] > faint_frames) | (touched[p] < 0.0f) ? 1.0f : 0.0f;
        // With graded influence, edges get extra rays only where objects have an effect.
        const int asks = (guide[GUIDE_ID * size + p] > 0.0f) & (squared[i] == 0.0f)
            & ((active[i] > 0.0f) | (faint_frames == 0.0f));
        ask = asks ? at_edges : ask;
    }
    if (ask > 0.0f)
        unlikeness(guide, sigma_position, size, stride, start, across, unlike);
    for (int i = 0; i < across; i++) {
        const int x = first + i, p = start + i;
        const float id = guide[GUIDE_ID * size + p];
        const int asks = (active[i] > 0.0f) | (faint_frames == 0.0f);
        const float differs = asks ? fmax(squared[i], unlike[i]) : squared[i];
        int chosen = differs >= high * high ? 0 : (differs >= low * low) | (active[i] > 0.0f) ? 1 : 2;
        const int waits = ((x - origin[0]) | (y - origin[1])) & 1;
        if ((chosen == 0) & (keep != 0) & waits) {
            const int q = pixel_before(motion, p, width, height, seam);
            if (q >= 0 && certainty[LENGTH_PLANE * size + q] > SETTLED_HISTORY)
                chosen = LEVEL_WAITING;
        }
        level[p] = id > 0.0f ? chosen : LEVEL_NONE;
    }
}

__kernel void list_traced(
    __global const uchar *restrict level[MOST_ENTRIES], // 1 plane
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    __global int *restrict list[MOST_ENTRIES],   // out: pixels that get a ray
    __global int *restrict count[MOST_ENTRIES],  // in, out: length of the list, 0 at the start
    __global const int *restrict origin,            // x y of the tracing grid in this frame
    int width,
    int height)
{
    const int row = get_global_id(0), place = get_global_id(1);
    __global const int *restrict listed = tile_list(tiles, layer, width, height);
    if (row >= TILE || place >= listed[0])
        return;
    const int tile = listed[1 + place], across = tiles_across(width);
    const int x0 = tile % across * TILE, x1 = min(x0 + TILE, width), y = tile / across * TILE + row;
    if (y >= height)
        return;
    int2 offset = vload2(0, origin);
    int traced = 0;
    for (int x = x0; x < x1; x++)
        traced += is_traced(level[plane_index(x, y, width)], x - offset.x, y - offset.y);
    int next = traced > 0 ? atomic_add(count, traced) : 0;
    for (int x = x0; x < x1; x++)
        if (is_traced(level[plane_index(x, y, width)], x - offset.x, y - offset.y))
            list[next++] = y * width + x;
}
