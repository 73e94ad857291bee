// Joins and leaf depth ranges of the background (remember.cl), as surface.cl makes those of the first
// layer: where nothing is hidden, that is what it is, and is copied.
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

__kernel void join_background(
    const int width,
    const int height,
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
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int texel = y * width + x;
    const int across[4] = {x + 1 < width ? x + 1 : 0, x > 0 ? x - 1 : width - 1, x, x};
    const int down[4] = {y, y, y - 1, y + 1};
    int hidden = kept_marks[texel];
    for (int i = 0; i < 4; i++)
        hidden |= kept_marks[clamp(down[i], 0, height - 1) * width + across[i]];
    if (!(hidden & SURFACE_HIDDEN)) {
        surface[texel] = first_surface[texel];
        range[texel] = first_range[texel];
        return;
    }
    const float d = kept_depth[texel];
    const int marks = kept_marks[texel];
    if (!isfinite(d)) {
        surface[texel] = (float4)(0.0f, 0.0f, 0.0f, (float)(SURFACE_NONE | marks));
        range[texel] = (float2)(INFINITY, INFINITY);
        return;
    }
    const Vectors g = vectors(vload3(texel, kept_plane));
    const Vectors v = vectors(centre_direction(azimuth[x], polar[y]));
    const float footprint = IPRT_PI / height;
    const int flag[4] = {SURFACE_EAST, SURFACE_WEST, SURFACE_NORTH, SURFACE_SOUTH};
    int flags = marks;
    float reach = footprint * d;
    for (int i = 0; i < 4; i++) {
        if (down[i] < 0 || down[i] >= height)
            continue;
        const int other = down[i] * width + across[i];
        const Vectors w = vectors(centre_direction(azimuth[across[i]], polar[down[i]]));
        const Vectors h = vectors(vload3(other, kept_plane));
        flags |= joined(d, g, v, 1.0f / kept_depth[other], h, w, footprint, &reach) ? flag[i] : 0;
    }
    float low = d, high = d;
    for (int corner = 0; corner < 4; corner++) {
        const float2 edge = column[x + (corner & 1)];
        const float c = row[y + (corner >> 1)];
        const float2 level = (float2)(c, sqrt(fmax(1.0f - c * c, 0.0f)));
        corner_radius(g, vectors(centre_direction(edge, level)), &low, &high);
    }
    const float bend = radius_bend(g, d, footprint);
    surface[texel] = (float4)(g.x, g.y, g.z, (float)flags);
    range[texel] = (float2)(fmax(low - bend, d - reach), fmin(high + bend, d + reach));
}
