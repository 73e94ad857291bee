// The background of a static camera's video: per texel of the panorama, the farthest surface seen there.
// Launched once per video frame, before background.cl joins the texels.
//
// in       inverse, surface          of the frame (inverse.cl, surface.cl); its radiance
// in, out  kept_depth                [H*W]    metres, INFINITY: open sky
//          kept_plane                [H*W*3]  g of the tangent plane (lib/world/real/real.h)
//          kept_color                [H*W*3]  radiance
//          kept_around               [H*W]    its magnitude: the slow mean of kept_depth; negative:
//                                             the color may be mixed with a nearer surface's
//          quiet                     per work item: what another frame with the same surfaces and
//                                             radiance would change
// out      kept_marks                [H*W]    SURFACE_OPENING, SURFACE_HIDDEN, SURFACE_AIMED
//          hidden_light              [H*W]    luminance of the background, where it is hidden by a
//                                             darker surface; else 0
//
// A surface of the frame replaces the background where it is as far or farther. A surface nearer by more
// than the assumed thickness hides the background, which stays. A surface nearer by less is the same
// surface, measured again, if it faces the same way. The foot of an object on a floor does not.
#include "maths/lanes.h"
#include "maths/maths.h"
#include "world/real/real.h"
#include "world/real/strips.h"

// Values of `quiet`. PLAIN: nothing is hidden or mixed, so that other radiance changes kept_color alone.
#define RESTLESS 0
#define QUIET 1
#define PLAIN 2

// Share of a difference by which a new measurement moves the mean depth. A faster mean would let an object
// that approaches slowly drag the background along.
#define FOLLOW 0.015625f
// Least cosine between normals of possibly the same surface.
#define SAME_NORMAL 0.7f
// Distance in texels over which cameras and codecs mix colors.
#define RIM 2
// Least relative noise of depth between frames, however thin surfaces are.
#define LEAST_MARGIN 0.02f

static inline float margin_at(float depth, float thickness_m, float thickness_ratio)
{
    return fmax(thickness_m, fmax(thickness_ratio, LEAST_MARGIN) * depth);
}

// Return whether planes face the same way.
static inline int same_facing(float3 g, float3 h)
{
    return dot(g, h) > SAME_NORMAL * sqrt(dot(g, g) * dot(h, h));
}

// Compute the depths of some texels, and whether a surface nearer by more than the margin is within RIM
// texels of each.
static inline void find_mixed(__global const float *restrict inverse,
                              __global const int4 *restrict lines, int x, int y, int height,
                              float thickness_m, float thickness_ratio, floats *now, floats *mixed)
{
    floats nearest = (floats)(0.0f);
    for (int dy = -RIM; dy <= RIM; dy++) {
        __global const float *line = inverse + lines[clamp(y + dy, 0, height - 1)].x + x;
        for (int dx = -RIM; dx <= RIM; dx++)
            nearest = fmax(nearest, fabs(load_floats(line + dx)));
    }
    const floats near = 1.0f / nearest;
    *now = 1.0f / fabs(load_floats(inverse + lines[y].x + x));
    const floats margin =
        fmax((floats)(thickness_m), fmax(thickness_ratio, LEAST_MARGIN) * near);
    *mixed = either(near + margin < *now, (floats)(1.0f), (floats)(0.0f));
}

static inline void copy_colors(__global const float *restrict from, __global float *restrict to,
                               int floats)
{
    const int whole = floats / LANES * LANES;
    for (int i = 0; i < whole; i += LANES)
        store_floats(load_floats(from + i), to + i);
    for (int i = whole; i < floats; i++)
        to[i] = from[i];
}

__kernel void remember(
    const int width,
    const int height,
    const int first,                            // row
    const int rows,
    const int left,                             // columns from here to `right` are another frame's;
    const int right,                            // elsewhere surfaces are the last frame's
    const int forget,                           // reset the background
    const float thickness_m,                      // metres, at least
    const float thickness_ratio,                // of the depth, at least
    __global const float *restrict inverse,
    __global const int4 *restrict lines,
    __global const float4 *restrict surface,
    __global const float *restrict radiance,    // 3 a texel
    __global const float4 *restrict strips,     // sums of pictures.cl
    __global float *restrict kept_depth,
    __global float *restrict kept_plane,
    __global float *restrict kept_color,
    __global float *restrict kept_around,
    __global uchar *restrict kept_marks,
    __global float *restrict hidden_light,
    __global uchar *restrict quiet)
{
    const int x0 = get_global_id(0) * LANES, y = first + get_global_id(1);
    if (x0 >= width || y >= min(first + rows, height))
        return;
    const int end = min(x0 + LANES, width);
    const int item = y * ((width + LANES - 1) / LANES) + x0 / LANES;
    const int was = forget || (end > left && x0 < right) ? RESTLESS : quiet[item];
    const int same = strips[y * ((width + STRIP - 1) / STRIP) + x0 / STRIP].w == 0.0f;
    if (was != RESTLESS && (same || was == PLAIN)) {
        const int from = 3 * (y * width + x0);
        if (!same)
            copy_colors(radiance + from, kept_color + from, 3 * (end - x0));
        return;
    }
    floats depth, mixed;
    find_mixed(inverse, lines, x0, y, height, thickness_m, thickness_ratio, &depth, &mixed);
    int state = PLAIN;
    for (int x = x0; x < end; x++) {
        const int texel = y * width + x;
        const float now = lane(&depth, x - x0);
        const float3 seen = vload3(texel, radiance);
        const float4 plane = surface[texel];
        const int marks = (int)plane.w & SURFACE_OPENING;
        const float before = forget ? 0.0f : kept_depth[texel];
        const float3 memory = forget ? (float3)(0.0f) : vload3(texel, kept_color);
        const float kept = forget ? 0.0f : kept_around[texel];
        const int known = forget ? 0 : kept_marks[texel];
        const float around = fabs(kept);
        const float margin = margin_at(around, thickness_m, thickness_ratio);

        // Infinities have no differences.
        const int uncovered = forget || now > around + margin;
        const int near = isfinite(around) && now >= around - margin;
        const int windows = marks & known & SURFACE_OPENING;
        if (!uncovered && !(now >= before || windows
                            || (near && same_facing(plane.xyz, vload3(texel, kept_plane))))) {
            const float light = luminance(memory);
            const int aimed = light > luminance(seen);
            kept_marks[texel] =
                (known & SURFACE_OPENING) | SURFACE_HIDDEN | (aimed ? SURFACE_AIMED : 0);
            hidden_light[texel] = aimed ? light : 0.0f;
            state = min(state, QUIET);
            continue;
        }
        const int rim = lane(&mixed, x - x0) > 0.0f;
        const float moved = around + FOLLOW * (now - around);
        const float centre = uncovered || !isfinite(moved) ? now : moved;
        const int cleaner = rim && !uncovered && kept > 0.0f;
        vstore3(cleaner ? memory : seen, texel, kept_color);
        kept_around[texel] = rim && !cleaner ? -centre : centre;
        kept_depth[texel] = now;
        vstore3(plane.xyz, texel, kept_plane);
        // Marks seldom change.
        if (forget || known != marks)
            kept_marks[texel] = marks;
        if (forget || (known & SURFACE_HIDDEN))
            hidden_light[texel] = 0.0f;
        state = min(state, centre != now ? RESTLESS : rim ? QUIET : PLAIN);
    }
    quiet[item] = state;
}
