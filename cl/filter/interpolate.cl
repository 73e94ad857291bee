// Interpolation of sparsely traced signals (IPRT Algorithm 2, with joint bilateral weights in
// place of weights that grow with distance).
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top.
//
//   in      guide (7 planes, guide.h), level (1 plane of uchar, 255 = nothing here)
//   in out  signal (filter/signal.h): valid at traced pixels, afterwards at all with a
//           surface; 0 where there is none. Only untraced pixels change and only traced ones
//           are read, so it is done in place. All planes share one set of weights.
#include "gbuffer/batch.h"
#include "gbuffer/guide.h"
#include "filter/signal.h"

#define SEARCH 3   // from any pixel, the coarsest grid (spacing 4) has a point this near

// Level of the pixel, LEVEL_NONE outside the picture.
static inline int level_at(
    __global const uchar *restrict level, int x, int y, int width, int height, int seam)
{
    x = wrap_column(x, width, seam);
    bool inside = x >= 0 && x < width && y >= 0 && y < height;
    return inside ? level[plane_index(x, y, width)] : LEVEL_NONE;
}

// Plane index of the pixel if it got a ray in this frame, else -1.
static inline int traced_at(
    __global const uchar *restrict level, int x, int y, int2 offset, int width, int height,
    int seam)
{
    int there = level_at(level, x, y, width, height, seam);
    x = wrap_column(x, width, seam);
    return is_traced(there, x - offset.x, y - offset.y) ? plane_index(x, y, width) : -1;
}

__kernel void interpolate(
    BATCHED(PLANES_IN, guide),                   // 7 planes
    SPAN_PARAMETERS,                             // where there are surfaces
    BATCHED(__global const uchar *restrict, level), // 1 plane
    BATCHED(__global float *, signal),           // in, out: its planes
    float normal_sharpness,               // falloff per 1 - cos of the normals' angle
    float plane_sharpness,                // falloff per plane distance / depth
    __global const int *restrict origin,  // x y of the tracing grid in this frame
    int width,
    int height,
    int seam,
    int planes)
{
    SPAN_ITEM;
    PLANES_IN guide = OF_BATCH(guide);
    __global const uchar *restrict level = OF_BATCH(level);
    __global float *signal = OF_BATCH(signal);
    int size = plane_size(width, height), p = plane_index(x, y, width);
    int own = level[p];
    int2 offset = vload2(0, origin);
    if (is_traced(own, x - offset.x, y - offset.y)) {
        EACH_PLANE(c, planes)
            store_border(signal + c * size, p, x, width, seam, signal[c * size + p]);
        return;
    }
    float sum[REAL_PLANES];
    EACH_PLANE(c, planes)
        sum[c] = 0.0f;
    float weights = 0.0f;
    if (own != LEVEL_NONE) {
        int spacing = level_spacing(own);
        int left = x - ((x - offset.x) & (spacing - 1)), top = y - ((y - offset.y) & (spacing - 1));
        // A corner of the level-1 grid that lies in a level-2 area may have no ray.
        for (int i = 0; i < 4 && spacing == 2; i++) {
            int cx = left + 2 * (i & 1), cy = top + 2 * (i >> 1);
            if (level_at(level, cx, cy, width, height, seam) == 2
                && traced_at(level, cx, cy, offset, width, height, seam) < 0)
                spacing = 4;
        }
        left = x - ((x - offset.x) & (spacing - 1));
        top = y - ((y - offset.y) & (spacing - 1));
        float nx = guide[p], ny = guide[size + p], nz = guide[2 * size + p];
        float px = guide[3 * size + p], py = guide[4 * size + p], pz = guide[5 * size + p];
        float id = guide[6 * size + p];
        float plane_scale = plane_sharpness / sqrt(fmax(px * px + py * py + pz * pz, 1e-30f));
        for (int i = 0; i < 4; i++) {
            int cx = left + spacing * (i & 1), cy = top + spacing * (i >> 1);
            int q = traced_at(level, cx, cy, offset, width, height, seam);
            if (q < 0)
                continue;
            float turn = 1.0f - (nx * guide[q] + ny * guide[size + q] + nz * guide[2 * size + q]);
            float off_plane = nx * (guide[3 * size + q] - px) + ny * (guide[4 * size + q] - py)
                              + nz * (guide[5 * size + q] - pz);
            float w = (spacing - abs(cx - x)) * (spacing - abs(cy - y))
                      * falloff(normal_sharpness * fmax(turn, 0.0f)
                                + plane_scale * fabs(off_plane));
            w = guide[6 * size + q] == id ? w : 0.0f;
            EACH_PLANE(c, planes)
                sum[c] += w * signal[c * size + q];
            weights += w;
        }
        if (weights < 1e-3f) {
            // No corner resembles this pixel: the nearest ray of its surface, else the nearest.
            int nearest = -1, distance = 1 << 20;
            for (int dy = -SEARCH; dy <= SEARCH; dy++)
                for (int dx = -SEARCH; dx <= SEARCH; dx++) {
                    int q = traced_at(level, x + dx, y + dy, offset, width, height, seam);
                    if (q < 0)
                        continue;
                    int d = dx * dx + dy * dy + (guide[6 * size + q] == id ? 0 : 1 << 10);
                    nearest = d < distance ? q : nearest;
                    distance = min(d, distance);
                }
            weights = nearest < 0 ? 0.0f : 1.0f;
            EACH_PLANE(c, planes)
                sum[c] = nearest < 0 ? 0.0f : signal[c * size + nearest];
        }
    }
    EACH_PLANE(c, planes)
        store_wrapped(signal + c * size, p, x, width, seam,
                      weights > 0.0f ? sum[c] / weights : 0.0f);
}
