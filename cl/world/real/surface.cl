// Tangent planes, connectivity and leaf depth ranges of the panorama.
//
// in   inverse  1/m, 0 in open sky, sign bit: opening; in lines (inverse.cl)
//      planes   g of the tangent planes, of some rows (planes.cl)
//      column   after MARGIN floats, cos of the azimuth of column edges; `edges` floats later, sin
//      row      [H+1]  cos of the polar angle of row edges
//      azimuth  after MARGIN floats, cos of the azimuth of column centres; `stride` floats later, sin
//      polar    [H]    (cos, sin) of the polar angle of row centres
// out  surface  [H*W]  xyz: g of the tangent plane g.x = 1; w: SURFACE_* flags (lib/world/real/real.h).
//                      A fitted plane that faces a different way than all neighbours' is replaced by
//                      a neighbour's, through the texel's own point: corners have too few samples.
//      range    [H*W]  smallest and largest radial distance of the plane within the texel
#include "world/real/joint.h"
#include "world/real/tangent.h"

static inline Vectors directions(floats cos_phi, floats sin_phi, float2 polar)
{
    const Vectors v = {polar.y * sin_phi, (floats)(polar.x), -polar.y * cos_phi};
    return v;
}

// The azimuth's (cos, sin) belong to the meridian's normal: direction (sin, ., -cos).
static inline Vectors corners(floats cos_phi, floats sin_phi, float c)
{
    const float s = sqrt(fmax(1.0f - c * c, 0.0f));
    return directions(cos_phi, sin_phi, (float2)(c, s));
}

static inline floats flagged(ints is, int flag)
{
    return either(is, (floats)(flag), (floats)(0.0f));
}

// Least cosine between neighbours that face the same way.
#define SAME_WAY 0.8f
// Largest departure from a neighbour's plane, over the depth, of a texel on that plane.
#define ON_PLANE 0.05f

// The plane of a texel at distance `d` towards v: its own, g, or a neighbour's.
typedef struct {
    ints alone;       // no neighbour so far faces the same way as g
    floats departure; // from the neighbour's plane that best explains the texel's depth
    Vectors plane;
} Company;

static inline void meet(Company *c, floats d, Vectors g, Vectors v, Vectors other)
{
    const floats inverse = along(other, v), facing = along(g, other);
    const floats departure = either(inverse > 0.0f, fabs(inverse * d - 1.0f), (floats)(INFINITY));
    const ints alike =
        facing > 0.0f && facing * facing > SAME_WAY * SAME_WAY * along(g, g) * along(other, other);
    c->alone = c->alone && !alike;
    const ints nearer = departure < c->departure;
    c->departure = either(nearer, departure, c->departure);
    const floats scale = 1.0f / either(inverse > 0.0f, inverse * d, (floats)(1.0f));
    c->plane.x = either(nearer, other.x * scale, c->plane.x);
    c->plane.y = either(nearer, other.y * scale, c->plane.y);
    c->plane.z = either(nearer, other.z * scale, c->plane.z);
}

__kernel void build_surface(
    const int width,
    const int height,
    const int first,                           // index of the first row to build
    const int rows,                            // to build; planes has one more at either end
    const int left,                            // first column to build
    const int stride,
    const int edges,
    const int fitted,                          // planes are fitted, none is from the source
    __global const float *restrict inverse,
    __global const int4 *restrict lines,
    __global const float *restrict planes,
    __global const float *restrict column,
    __global const float *restrict row,
    __global const float *restrict azimuth,
    __global const float2 *restrict polar,
    __global float4 *restrict surface,         // out
    __global float2 *restrict range)           // out
{
    const int x = left + get_global_id(0) * LANES, own = get_global_id(1), y = first + own;
    if (x >= width || own >= rows)
        return;
    const int image = (rows + 2) * stride;
    __global const float *from = inverse + lines[y].x + x;
    __global const float *line = planes + MARGIN + (own + 1) * stride;
    const floats f = load_floats(from);
    const ints there = f != 0.0f;
    const floats d = 1.0f / either(there, fabs(f), (floats)(1.0f));
    const Vectors g = {load_floats(line + x), load_floats(line + image + x),
                       load_floats(line + 2 * image + x)};
    __global const float *cosines = azimuth + MARGIN, *sines = cosines + stride;
    const floats cos_phi = load_floats(cosines + x), sin_phi = load_floats(sines + x);
    const Vectors v = directions(cos_phi, sin_phi, polar[y]);
    const float footprint = IPRT_PI / height;

    Company near_by = {there, (floats)(INFINITY), g};
    floats reach = footprint * d;   // how far the plane may leave the centre's depth in the texel
    floats flags = either(bits_of(f) < 0, (floats)(SURFACE_OPENING), (floats)(0.0f));
    const Vectors east = {load_east(line, x, width), load_east(line + image, x, width),
                          load_east(line + 2 * image, x, width)};
    const Vectors to_east =
        directions(load_east(cosines, x, width), load_east(sines, x, width), polar[y]);
    flags += flagged(joined(d, g, v, fabs(load_floats(from + 1)), east, to_east, footprint, &reach),
                     SURFACE_EAST);
    meet(&near_by, d, g, v, east);
    const Vectors west = {load_west(line, x, width), load_west(line + image, x, width),
                          load_west(line + 2 * image, x, width)};
    const Vectors to_west =
        directions(load_west(cosines, x, width), load_west(sines, x, width), polar[y]);
    flags += flagged(joined(d, g, v, fabs(load_floats(from - 1)), west, to_west, footprint, &reach),
                     SURFACE_WEST);
    meet(&near_by, d, g, v, west);
    for (int i = 0; i < 2; i++) {
        const int side = 2 * i - 1;
        if (y + side < 0 || y + side >= height)
            continue;
        __global const float *other = line + side * stride;
        const Vectors h = {load_floats(other + x), load_floats(other + image + x),
                           load_floats(other + 2 * image + x)};
        const Vectors w = directions(cos_phi, sin_phi, polar[y + side]);
        const floats near = fabs(load_floats(inverse + lines[y + side].x + x));
        flags += flagged(joined(d, g, v, near, h, w, footprint, &reach),
                         side < 0 ? SURFACE_NORTH : SURFACE_SOUTH);
        meet(&near_by, d, g, v, h);
    }

    const ints replaced = near_by.alone && near_by.departure < ON_PLANE && (ints)(-fitted);
    const Vectors shown = {either(replaced, near_by.plane.x, g.x),
                           either(replaced, near_by.plane.y, g.y),
                           either(replaced, near_by.plane.z, g.z)};
    floats low = d, high = d;
    for (int side = 0; side < 2; side++) {
        const floats edge_cos = load_floats(column + MARGIN + x + side);
        const floats edge_sin = load_floats(column + MARGIN + edges + x + side);
        corner_radius(shown, corners(edge_cos, edge_sin, row[y]), &low, &high);
        corner_radius(shown, corners(edge_cos, edge_sin, row[y + 1]), &low, &high);
    }
    const floats bend = radius_bend(shown, d, footprint);
    low = either(there, fmax(low - bend, d - reach), (floats)(INFINITY));
    high = either(there, fmin(high + bend, d + reach), (floats)(INFINITY));
    flags = either(there, flags, either(bits_of(f) < 0, (floats)(SURFACE_NONE | SURFACE_OPENING),
                                        (floats)(SURFACE_NONE)));
    const int texel = y * width + x, count = min(width - x, LANES);
    for (int i = 0; i < count; i++) {
        surface[texel + i] =
            (float4)(lane(&shown.x, i), lane(&shown.y, i), lane(&shown.z, i), lane(&flags, i));
        range[texel + i] = (float2)(lane(&low, i), lane(&high, i));
    }
}
