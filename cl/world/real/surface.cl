// Tangent planes, connectivity and leaf depth ranges of the panorama.
//
// in   depth     [H*W]    metres from the capture centre; INFINITY: open sky
//      normal    [H*W*3]  world, unit, facing the capture centre
//      marks     [H*W]    SURFACE_* flags to be set: OPENING where the source has no depth
//      column    [W+1]    (cos, sin) of the azimuth of column edges
//      row       [H+1]    cos of the polar angle of row edges
//      azimuth   [W]      (cos, sin) of the azimuth of column centres
//      polar     [H]      (cos, sin) of the polar angle of row centres
// out  surface   [H*W]    xyz: g of the tangent plane g.x = 1; w: SURFACE_* flags (lib/world/real/real.h)
//      range     [H*W]    smallest and largest radial distance of the plane within the texel
//
// -D BACKGROUND makes the layer that is remembered (remember.cl): where nothing is hidden, it is the
// first layer, which is copied.
//
// Two neighbours are connected when the step between them is explained by the tangent plane of
// either, or is below three texel footprints: only other steps are gaps a ray can pass.
#include "world/real/real.h"

// Planes seen at less than this cosine are tilted towards the viewer, so that g stays bounded.
#define GRAZING 0.02f
#define STEP_FOOTPRINTS 3.0f

// Unit direction of the centre of a texel, from tables: sines would take most of the kernel's time.
static inline float3 centre_direction(float2 azimuth, float2 polar)
{
    return (float3)(polar.y * azimuth.y, polar.x, -polar.y * azimuth.x);
}

static inline float3 tangent_plane(float depth, float3 n, float3 v)
{
    float facing = dot(n, v);
    if (!(facing < -GRAZING)) {
        n -= (facing + GRAZING) * v;
        facing = -GRAZING;
    }
    return n / (facing * depth);
}

static inline float3 plane_at(
    __global const float *restrict depth, __global const float *restrict normal, int texel, float3 v)
{
    const float3 n = (float3)(normal[3 * texel], normal[3 * texel + 1], normal[3 * texel + 2]);
    return tangent_plane(depth[texel], n, v);
}

static inline float radius_towards(float3 g, float3 v)
{
    float inverse = dot(g, v);
    return inverse > 0.0f ? 1.0f / inverse : INFINITY;
}

__kernel void build_surface(
    const int width,
    const int height,
    __global const float *restrict depth,      // metres
    __global const float *restrict normal,     // world
    __global const uchar *restrict marks,
    __global const float2 *restrict column,    // column edges
    __global const float *restrict row,        // row edges
    __global const float2 *restrict azimuth,   // column centres
    __global const float2 *restrict polar,     // row centres
#ifdef BACKGROUND
    __global const float4 *restrict first_surface,
    __global const float2 *restrict first_range,
#endif
    __global float4 *restrict surface,         // out
    __global float2 *restrict range)           // out
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int texel = y * width + x;
    const int step_x[4] = {1, -1, 0, 0};
    const int step_y[4] = {0, 0, -1, 1};
#ifdef BACKGROUND
    int hidden = marks[texel];
    for (int i = 0; i < 4; i++)
        hidden |= marks[clamp(y + step_y[i], 0, height - 1) * width + (x + step_x[i] + width) % width];
    if (!(hidden & SURFACE_HIDDEN)) {
        surface[texel] = first_surface[texel];
        range[texel] = first_range[texel];
        return;
    }
#endif
    const float d = depth[texel];
    if (!isfinite(d)) {
        surface[texel] = (float4)(0.0f, 0.0f, 0.0f, (float)(SURFACE_NONE | marks[texel]));
        range[texel] = (float2)(INFINITY, INFINITY);
        return;
    }
    const float3 v = centre_direction(azimuth[x], polar[y]);
    const float3 g = plane_at(depth, normal, texel, v);
    const float footprint = IPRT_PI / height;

    const int flag[4] = {SURFACE_EAST, SURFACE_WEST, SURFACE_NORTH, SURFACE_SOUTH};
    int flags = marks[texel];
    float reach = footprint * d;   // how far the plane may leave the centre's depth in the texel
    for (int i = 0; i < 4; i++) {
        const int ny = y + step_y[i];
        const int nx = (x + step_x[i] + width) % width;
        if (ny < 0 || ny >= height)
            continue;
        const int other = ny * width + nx;
        const float e = depth[other];
        if (!isfinite(e))
            continue;
        const float3 w = centre_direction(azimuth[nx], polar[ny]);
        const float3 h = plane_at(depth, normal, other, w);
        const float unexplained = fmin(fabs(d - e), fmin(fabs(radius_towards(g, w) - e),
                                                         fabs(radius_towards(h, v) - d)));
        if (unexplained <= STEP_FOOTPRINTS * footprint * fmin(d, e)) {
            flags |= flag[i];
            reach = fmax(reach, fabs(d - e));
        }
    }

    float low = d, high = d;
    for (int corner = 0; corner < 4; corner++) {
        const float2 edge = column[x + (corner & 1)];
        const float c = row[y + (corner >> 1)];
        const float s = sqrt(fmax(1.0f - c * c, 0.0f));
        // The azimuth's (cos, sin) are those of the meridian's normal: direction (sin, ., -cos).
        const float radius = radius_towards(g, (float3)(s * edge.y, c, -s * edge.x));
        low = fmin(low, radius);
        high = fmax(high, radius);
    }
    // Within the texel the radius bends away from that at the corners: second derivative
    // r (1 + 2 tan^2) at the angle whose cosine is 1 / (|g| d).
    const float bend = 0.25f * footprint * footprint * d * (2.0f * dot(g, g) * d * d - 1.0f);
    surface[texel] = (float4)(g, (float)flags);
    range[texel] = (float2)(fmax(low - bend, d - reach), fmin(high + bend, d + reach));
}
