// The background of a static camera's video: per texel of the panorama, the farthest surface that
// was seen there. Launched once per video frame, before surface.cl makes planes of it.
//
// in       depth, normal, radiance   of the frame; marks: SURFACE_OPENING (lib/world/real/real.h)
// in, out  kept_depth                [H*W]    metres, INFINITY: open sky
//          kept_normal               [H*W*3]  world
//          kept_color                [H*W*4]  rgb radiance; |w|: the depth around which kept_depth
//                                             moves, w < 0: the colour may hold some of what is nearer
// out      kept_marks                [H*W]    SURFACE_OPENING, SURFACE_HIDDEN, SURFACE_AIMED
//          hidden_light              [H*W]    luminance of what is hidden, where that is brighter
//                                             than what hides it; else 0
//
// What the frame shows is taken over where it is as far as what is remembered or farther. Where it
// is nearer by more than the thickness that all surfaces are assumed to have, it hides what is
// remembered, which stays. What is nearer by less is the same surface, and measured anew, if it faces
// the same way: the foot of a thing that stands on a floor does not.
#include "maths/maths.h"
#include "world/real/real.h"

// Depth that is measured anew moves the depth that it may differ from by so much of the difference:
// at once, a thing that nears slowly would draw the background along.
#define FOLLOW 0.015625f
// Cosine between normals of what may be the same surface.
#define SAME_NORMAL 0.7f
// Cameras and codecs mix the colours of texels so far apart.
#define RIM 2
// Depth differs by so much of itself from frame to frame, however thin surfaces are.
#define LEAST_MARGIN 0.02f

static inline float margin_at(float depth, float thickness, float thickness_ratio)
{
    return fmax(thickness, fmax(thickness_ratio, LEAST_MARGIN) * depth);
}

__kernel void remember(
    const int width,
    const int height,
    const int forget,                           // all that was remembered
    const float thickness,                      // metres, at least
    const float thickness_ratio,                // of the depth, at least
    __global const float *restrict depth,
    __global const float *restrict normal,
    __global const uchar *restrict marks,
    __global const float4 *restrict radiance,
    __global float *restrict kept_depth,
    __global float *restrict kept_normal,
    __global float4 *restrict kept_color,
    __global uchar *restrict kept_marks,
    __global float *restrict hidden_light)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int texel = y * width + x;
    const float now = depth[texel];
    const float3 n = vload3(texel, normal);
    const float4 seen = radiance[texel];
    const float before = forget ? 0.0f : kept_depth[texel];
    const float4 memory = forget ? (float4)(0.0f) : kept_color[texel];
    const float around = fabs(memory.w);
    const float margin = margin_at(around, thickness, thickness_ratio);

    // Infinities have no differences.
    const int uncovered = forget || now > around + margin;
    const int alike = !forget && isfinite(around) && now >= around - margin
        && dot(n, vload3(texel, kept_normal)) > SAME_NORMAL;
    const int windows = !forget && marks[texel] & kept_marks[texel] & SURFACE_OPENING;
    if (!uncovered && !(now >= before || alike || windows)) {
        const float light = luminance(memory.xyz);
        const int aimed = light > luminance(seen.xyz);
        kept_marks[texel] = (kept_marks[texel] & SURFACE_OPENING) | SURFACE_HIDDEN
            | (aimed ? SURFACE_AIMED : 0);
        hidden_light[texel] = aimed ? light : 0.0f;
        return;
    }

    int mixed = 0;
    for (int dy = -RIM; dy <= RIM; dy++)
        for (int dx = -RIM; dx <= RIM; dx++) {
            const int column = (x + dx + 2 * width) % width, row = clamp(y + dy, 0, height - 1);
            const float near = depth[row * width + column];
            mixed |= near + margin_at(near, thickness, thickness_ratio) < now;
        }
    const float moved = around + FOLLOW * (now - around);
    const float centre = uncovered || !isfinite(moved) ? now : moved;
    float4 color = (float4)(seen.xyz, mixed ? -centre : centre);
    if (mixed && !uncovered && memory.w > 0.0f)
        color = (float4)(memory.xyz, centre);
    kept_color[texel] = color;
    kept_depth[texel] = now;
    vstore3(n, texel, kept_normal);
    kept_marks[texel] = marks[texel];
    hidden_light[texel] = 0.0f;
}
