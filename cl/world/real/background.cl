// Joints and leaf depth ranges of the background (remember.cl), as surface.cl computes them for the first
// layer. Where nothing is hidden, the background equals the first layer and is copied.
//
// in   kept_depth, kept_plane, kept_marks  remember.cl
//      column, row                         (cos, sin) of the azimuth of column edges; cos of the polar
//                                          angle of row edges
//      azimuth, polar                      (cos, sin) of texels' centres
//      first_surface, first_range          of the first layer
// out  surface, range                      surface.cl
#include "world/real/joint.h"
#include "world/real/tangent.h"

static inline Vectors vectors(float3 v)
{
    const Vectors same = {v.x, v.y, v.z};
    return same;
}

// Adjacent texels per work item.
#define STRIP 16

typedef struct {
    int width;
    int height;
    __global const float *depth;
    __global const float *plane;
    __global const uchar *marks;
    __global const float2 *column;
    __global const float *row;
    __global const float2 *azimuth;
    __global const float2 *polar;
} Kept;

// Return whether something is hidden at a texel from x to `end` of a row, or at a direct neighbour.
static inline int hides(__global const uchar *restrict marks, int x, int end, int y, int width,
                        int height)
{
    int hidden = marks[y * width + (x > 0 ? x - 1 : width - 1)]
        | marks[y * width + (end < width ? end : 0)];
    const int above = max(y - 1, 0) * width, below = min(y + 1, height - 1) * width;
    for (int i = x; i < end; i++)
        hidden |= marks[above + i] | marks[y * width + i] | marks[below + i];
    return hidden & SURFACE_HIDDEN;
}

static inline void join_texel(const Kept kept, int x, int y, float4 *surface, float2 *range)
{
    const int width = kept.width, texel = y * width + x;
    const float d = kept.depth[texel];
    int flags = kept.marks[texel];
    if (!isfinite(d)) {
        *surface = (float4)(0.0f, 0.0f, 0.0f, (float)(SURFACE_NONE | flags));
        *range = (float2)(INFINITY, INFINITY);
        return;
    }
    const Vectors g = vectors(vload3(texel, kept.plane));
    const Vectors v = vectors(centre_direction(kept.azimuth[x], kept.polar[y]));
    const float footprint = IPRT_PI / kept.height;
    float reach = footprint * d, low = d, high = d;
    // East, west, north, south. Not unrolled, which halves the registers.
    #pragma unroll 1
    for (int i = 0; i < 4; i++) {
        const int row = y + (i == 3) - (i == 2), aside = x + (i == 0) - (i == 1);
        if (row < 0 || row >= kept.height)
            continue;
        const int column = aside < 0 ? width - 1 : aside >= width ? 0 : aside;
        const int other = row * width + column;
        const Vectors w = vectors(centre_direction(kept.azimuth[column], kept.polar[row]));
        const Vectors h = vectors(vload3(other, kept.plane));
        if (joined(d, g, v, 1.0f / kept.depth[other], h, w, footprint, &reach))
            flags |= SURFACE_EAST << i;
    }
    #pragma unroll 1
    for (int corner = 0; corner < 4; corner++) {
        const float c = kept.row[y + (corner >> 1)];
        const float2 level = (float2)(c, sqrt(fmax(1.0f - c * c, 0.0f)));
        const float2 edge = kept.column[x + (corner & 1)];
        corner_radius(g, vectors(centre_direction(edge, level)), &low, &high);
    }
    const float bend = radius_bend(g, d, footprint);
    *surface = (float4)(g.x, g.y, g.z, (float)flags);
    *range = (float2)(fmax(low - bend, d - reach), fmin(high + bend, d + reach));
}

__kernel void join_background(
    const int width,
    const int height,
    const int first,                           // row
    const int rows,
    __global const float *restrict kept_depth,
    __global const float *restrict kept_plane,
    __global const uchar *restrict kept_marks,
    __global const float2 *restrict column,
    __global const float *restrict row,
    __global const float2 *restrict azimuth,
    __global const float2 *restrict polar,
    __global const float4 *restrict first_surface,
    __global const float2 *restrict first_range,
    __global float4 *restrict surface,         // out
    __global float2 *restrict range)           // out
{
    const int x = get_global_id(0) * STRIP, y = first + get_global_id(1);
    if (x >= width || y >= min(first + rows, height))
        return;
    const int end = min(x + STRIP, width), line = y * width;
    if (!hides(kept_marks, x, end, y, width, height)) {
        for (int i = line + x; i < line + end; i++)
            surface[i] = first_surface[i];
        for (int i = line + x; i < line + end; i++)
            range[i] = first_range[i];
        return;
    }
    const Kept kept = {width, height, kept_depth, kept_plane, kept_marks,
                       column, row, azimuth, polar};
    for (int i = x; i < end; i++) {
        float4 g = first_surface[line + i];
        float2 bounds = first_range[line + i];
        if (hides(kept_marks, i, i + 1, y, width, height))
            join_texel(kept, i, y, &g, &bounds);
        surface[line + i] = g;
        range[line + i] = bounds;
    }
}
