// Tangent planes of the panorama's texels: g with g.x = 1 for the points x of a plane.
//
//   kernel       in                              out
//   fit_planes   inverse (inverse.cl)            planes: least squares in windows of 5 x 5 texels
//   take_planes  inverse, normals of the source  planes, where the source has a normal
//
// planes: three images, of x, y and z, for a band of rows and one row beyond either end, `stride` floats a
// row, after MARGIN floats; 0 in open sky
//
// The method of Schwandt et al., "Natural Environment Illumination", section 5 (one plane per texel, small
// normal equations solved by determinants instead of an SVD), fitted in inverse depth: with tangent
// coordinates (a, b) about a texel's direction, a plane n.p = 1 is 1/z = n_c + n_a a + n_b b, linear in the
// unknowns and exact for planes at any slant. Windows do not extend across depth gaps. They never mix
// openings, whose depth is interpolated, with measured depth.
#include "maths/lanes.h"
#include "world/real/tangent.h"

// Index of the tap `down` rows below and `aside` columns to the right, among the 25 of a row.
#define TAP(down, aside) (5 * ((down) + 2) + (aside) + 2)
// Inverse depth has a slope where its relative departure from a line is no more than this.
#define ROUGHEST 0.05f
#define MIN_SAMPLES 3.0f

typedef struct {
    float scale;   // 1 / cosine of the angle to the neighbour, a factor of 1/z
    float a;       // tangent coordinates
    float b;
    int line;      // index in `inverse` of the neighbour of column 0
} Tap;

// Return the rise of 1/z over the centre. A neighbour more than about 75 degrees away gets a rise that no
// plane has.
static inline floats rise_at(__global const float *restrict inverse, const Tap tap, int x,
                             floats centre)
{
    return fabs(load_floats(inverse + tap.line + x)) * tap.scale - centre;
}

// Return the slope along a line of samples at -2, -1, 1 and 2 steps: the mean of both sides where they
// differ no more than either bends; else, at an edge, the smoother side's (like the stencils of ENO
// schemes). 0 where both sides are gaps.
static inline floats line_slope(const floats *rise, const float *at, floats centre)
{
    const floats before = rise[1] / at[1], after = rise[2] / at[2];
    const floats before_bend = fabs((rise[0] - rise[1]) / (at[0] - at[1]) - before);
    const floats after_bend = fabs((rise[3] - rise[2]) / (at[3] - at[2]) - after);
    const floats least = fmin(before_bend, after_bend);
    const floats one_sided = either(before_bend <= after_bend, before, after);
    const floats slope =
        either(fabs(before - after) <= 2.0f * least, 0.5f * (before + after), one_sided);
    const float step = fmax(fabs(at[1]), fabs(at[2]));
    const ints surface = least * step <= ROUGHEST * centre && isfinite(slope);
    return either(surface, slope, (floats)(0.0f));
}

// Return 1 where a texel of the window lies on the local plane, else 0; `rise` gets its rise there.
static inline floats on_plane(__global const float *restrict inverse, const Tap tap, int x,
                              floats own, floats expected, floats farthest, floats *rise)
{
    const floats there = load_floats(inverse + tap.line + x);
    const floats rises = fabs(there) * tap.scale - fabs(own);
    const ints alike = (bits_of(there) ^ bits_of(own)) >= 0;
    const ints is = alike && fabs(rises - expected) <= farthest;
    *rise = either(is, rises, (floats)(0.0f));
    return either(is, (floats)(1.0f), (floats)(0.0f));
}

__kernel void fit_planes(
    const int width,
    const int height,
    const int first,                           // index of the first row in `planes`
    const int rows,
    const int left,                            // first column to fit
    const int stride,
    const float tolerance,                     // largest distance from the local plane, over depth
    __global const float *restrict inverse,
    __global const int4 *restrict lines,       // inverse.cl
    __global const Tap *restrict taps,         // 25 of each row
    __global const float *restrict azimuth,    // after MARGIN floats, cosines of column centres;
                                               // `stride` floats later, sines
    __global const float2 *restrict polar,     // (cos, sin) of row centres
    __global float *restrict planes)           // out
{
    const int x = left + get_global_id(0) * LANES, row = get_global_id(1), y = first + row;
    if (x >= width || row >= rows || y < 0 || y >= height)
        return;
    __global const Tap *tap = taps + 25 * y;
    const floats own = load_floats(inverse + lines[y].x + x);
    const floats centre = fabs(own);
    floats rise[4];
    float at[4];
    const int steps[4] = {-2, -1, 1, 2};
    for (int i = 0; i < 4; i++) {
        const Tap near = tap[TAP(-steps[i], 0)];
        rise[i] = rise_at(inverse, near, x, centre);
        at[i] = near.b;
    }
    const floats slope_b = line_slope(rise, at, centre);
    for (int i = 0; i < 4; i++) {
        // A parallel departs from the great circle: its texels do not lie at b = 0.
        const Tap near = tap[TAP(0, steps[i])];
        rise[i] = rise_at(inverse, near, x, centre) - slope_b * near.b;
        at[i] = near.a;
    }
    const floats slope_a = line_slope(rise, at, centre);

    // Moments of a, b and inverse depth over the texels on the local plane. Two texels the same number of
    // steps to either side have opposite a and the same b: they are summed as pairs.
    const floats farthest = tolerance * centre;
    floats n = (floats)(1.0f), a = (floats)(0.0f), b = a, aa = a, ab = a, bb = a;
    floats f = a, af = a, bf = a;
    for (int i = 0; i < 15; i++) {
        const int down = i / 3 - 2, aside = i % 3;
        if (i == 6)
            continue;
        const Tap near = tap[TAP(down, aside)];
        const floats expected = slope_b * near.b, turn = slope_a * near.a;
        floats rises;
        floats weight = on_plane(inverse, near, x, own, expected + turn, farthest, &rises);
        if (aside > 0) {
            floats other_rises;
            const floats other = on_plane(inverse, tap[TAP(down, -aside)], x, own,
                                          expected - turn, farthest, &other_rises);
            const floats more = weight - other;
            a += more * near.a;
            ab += more * (near.a * near.b);
            af += (rises - other_rises) * near.a;
            weight += other;
            rises += other_rises;
        }
        n += weight;
        f += rises;
        b += weight * near.b;
        bb += weight * (near.b * near.b);
        bf += rises * near.b;
        aa += weight * (near.a * near.a);
    }
    // About the mean: the plane need not pass through the texel itself.
    const floats share = 1.0f / n;
    aa -= a * a * share;
    ab -= a * b * share;
    bb -= b * b * share;
    af -= a * f * share;
    bf -= b * f * share;
    const floats determinant = aa * bb - ab * ab, trace = aa + bb;
    ints solvable = n >= MIN_SAMPLES && determinant > 1e-3f * trace * trace
        && determinant > FLT_MIN;
    const floats scale = 1.0f / either(solvable, determinant, (floats)(1.0f));
    floats east = (bb * af - ab * bf) * scale, north = (aa * bf - ab * af) * scale;
    floats ahead = centre + (f - east * a - north * b) * share;
    solvable = solvable && ahead > 0.0f;
    east = either(solvable, east, slope_a);
    north = either(solvable, north, slope_b);
    ahead = either(solvable, ahead, centre);

    // Tilted if seen at a grazing angle, and moved to pass through the texel itself.
    ahead = fmax(ahead, GRAZING * sqrt(east * east + north * north + ahead * ahead));
    const floats through = either(centre > 0.0f, centre / ahead, (floats)(0.0f));
    const floats cos_phi = load_floats(azimuth + MARGIN + x);
    const floats sin_phi = load_floats(azimuth + MARGIN + stride + x);
    const float2 theta = polar[y];
    const floats outward = centre * theta.y - through * north * theta.x;
    const int size = rows * stride, to = MARGIN + row * stride + x;
    store_floats(outward * sin_phi + through * east * cos_phi, planes + to);
    store_floats(centre * theta.x + through * north * theta.y, planes + size + to);
    store_floats(through * east * sin_phi - outward * cos_phi, planes + 2 * size + to);
}

__kernel void take_planes(
    const int width,
    const int height,
    const int first,                           // index of the first row in `planes`
    const int rows,
    const int stride,
    __global const float *restrict inverse,
    __global const int4 *restrict lines,       // inverse.cl
    __global const float *restrict normals,    // of these rows
    __global const float2 *restrict azimuth,   // (cos, sin) of column centres
    __global const float2 *restrict polar,
    __global float *restrict planes)           // in, out
{
    const int x = get_global_id(0), row = get_global_id(1), y = first + row;
    if (x >= width || row >= rows || y < 0 || y >= height)
        return;
    const float3 given = vload3(row * width + x, normals);
    const float centre = fabs(inverse[lines[y].x + x]), size = length(given);
    if (!(size > LEAST_NORMAL && isfinite(size)))
        return;
    const float3 v = centre_direction(azimuth[x], polar[y]);
    const float facing = dot(given, v) / size;
    // Towards the centre, whichever side the source gives.
    const float3 g = tangent_plane(given * (facing > 0.0f ? -1.0f / size : 1.0f / size), v) * centre;
    const int image = rows * stride, to = MARGIN + row * stride + x;
    planes[to] = g.x;
    planes[image + to] = g.y;
    planes[2 * image + to] = g.z;
}
