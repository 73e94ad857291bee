// The view's projection. `view` is the 16-float block of View.kernel_constants(): rows of world_from_view,
// focal length and centre in pixels, width, height, and 1 for an equirect projection, 0 for a perspective
// one.
#pragma once

#include "maths/equirect.h"

// An object up to this fraction of the distance behind the real surface still counts as in front, so that
// noise in measured depth does not erode its foot.
#define COVERAGE_TOLERANCE 0.005f

static inline int is_equirect(__global const float *restrict view) { return view[14] != 0.0f; }

// Scalar arithmetic: PoCL vectorizes kernels of scalars only.

static inline float3 view_rotate_to_world(__global const float *restrict view, float3 v)
{
    return (float3)(view[0] * v.x + view[1] * v.y + view[2] * v.z,
                    view[3] * v.x + view[4] * v.y + view[5] * v.z,
                    view[6] * v.x + view[7] * v.y + view[8] * v.z);
}

// The same sum must not occur twice in a row: the compiler would add both as a vector of two, which keeps
// PoCL from vectorizing the kernel.
static inline float3 view_rotate_to_local(__global const float *restrict view, float3 v)
{
    return (float3)(view[0] * v.x + view[3] * v.y + view[6] * v.z,
                    view[7] * v.z + view[4] * v.y + view[1] * v.x,
                    view[2] * v.x + view[5] * v.y + view[8] * v.z);
}

// Return the unit direction through the image point p (pixels), in view space.
static inline float3 view_local_direction(__global const float *restrict view, float2 p)
{
    if (is_equirect(view))
        return equirect_direction(p.x / view[12], p.y / view[13]);
    const float right = p.x - view[10], up = view[11] - p.y, back = -view[9];
    const float inverse = 1.0f / sqrt(right * right + up * up + back * back);
    return (float3)(right * inverse, up * inverse, back * inverse);
}

// Return the same direction in world space.
static inline float3 view_direction(__global const float *restrict view, float2 p)
{
    return view_rotate_to_world(view, view_local_direction(view, p));
}

// Return the image point (pixels) of a world point; (-1e9, -1e9) behind the camera.
static inline float2 view_project(__global const float *restrict view, float3 point)
{
    float3 p = view_rotate_to_local(view, point);
    if (is_equirect(view)) {
        const float2 uv = equirect_uv(p);
        return (float2)(uv.x * view[12], uv.y * view[13]);
    }
    const int in_front = p.z < 0.0f;
    return (float2)(in_front ? view[10] - view[9] * p.x / p.z : -1e9f,
                    in_front ? view[11] + view[9] * p.y / p.z : -1e9f);
}
