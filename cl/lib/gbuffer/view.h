// The view's projection. `view` is the 16-float block of View.kernel_constants(): rows of world_from_view,
// focal length and centre in pixels, width, height, and 1 for an equirect projection, 0 for a perspective
// one.
#pragma once

#include "maths/equirect.h"

// An object up to this fraction of the distance behind the real surface still counts as in front, so that
// noise in measured depth does not erode its foot.
#define COVERAGE_TOLERANCE 0.005f

static inline int is_equirect(__global const float *restrict view) { return view[14] != 0.0f; }

// Scalar arithmetic: PoCL vectorizes kernels of scalars without branches only. Functions whose names end in
// `_unbranched` are for these: they compute both projections.

// Return the value of the view's projection.
static inline ALWAYS_INLINE float projected(int equirect, float around, float ahead)
{
    return equirect ? around : ahead;
}

static inline ALWAYS_INLINE float3 view_rotate_to_world(__global const float *restrict view, float3 v)
{
    return (float3)(view[0] * v.x + view[1] * v.y + view[2] * v.z,
                    view[3] * v.x + view[4] * v.y + view[5] * v.z,
                    view[6] * v.x + view[7] * v.y + view[8] * v.z);
}

// The same sum must not occur twice in a row: the compiler would add both as a vector of two, which keeps
// PoCL from vectorizing the kernel.
static inline ALWAYS_INLINE float3 view_rotate_to_local(__global const float *restrict view, float3 v)
{
    return (float3)(view[0] * v.x + view[3] * v.y + view[6] * v.z,
                    view[7] * v.z + view[4] * v.y + view[1] * v.x,
                    view[2] * v.x + view[5] * v.y + view[8] * v.z);
}

static inline ALWAYS_INLINE float3 direction_around(__global const float *restrict view, float2 p)
{
    return equirect_direction(p.x / view[12], p.y / view[13]);
}

static inline ALWAYS_INLINE float3 direction_ahead(__global const float *restrict view, float2 p)
{
    const float right = p.x - view[10], up = view[11] - p.y, back = -view[9];
    const float inverse = 1.0f / sqrt(right * right + up * up + back * back);
    return (float3)(right * inverse, up * inverse, back * inverse);
}

// Return the unit direction through the image point p (pixels), in view space.
static inline float3 view_local_direction(__global const float *restrict view, float2 p)
{
    return is_equirect(view) ? direction_around(view, p) : direction_ahead(view, p);
}

static inline ALWAYS_INLINE float3 local_direction_unbranched(__global const float *restrict view, float2 p)
{
    const int equirect = is_equirect(view);
    const float3 around = direction_around(view, p), ahead = direction_ahead(view, p);
    return (float3)(projected(equirect, around.x, ahead.x), projected(equirect, around.y, ahead.y),
                    projected(equirect, around.z, ahead.z));
}

// Return the same direction in world space.
static inline float3 view_direction(__global const float *restrict view, float2 p)
{
    return view_rotate_to_world(view, view_local_direction(view, p));
}

static inline ALWAYS_INLINE float3 direction_unbranched(__global const float *restrict view, float2 p)
{
    return view_rotate_to_world(view, local_direction_unbranched(view, p));
}

// Return the image point (pixels) of p, in view space; (-1e9, -1e9) behind the camera.
static inline ALWAYS_INLINE float2 point_around(__global const float *restrict view, float3 p)
{
    const float2 uv = equirect_uv(p);
    return (float2)(uv.x * view[12], uv.y * view[13]);
}

static inline ALWAYS_INLINE float2 point_ahead(__global const float *restrict view, float3 p)
{
    const int in_front = p.z < 0.0f;
    const float column = view[10] - view[9] * p.x / p.z, row = view[11] + view[9] * p.y / p.z;
    return (float2)(in_front ? column : -1e9f, in_front ? row : -1e9f);
}

// Return the image point of a world point.
static inline float2 view_project(__global const float *restrict view, float3 point)
{
    const float3 p = view_rotate_to_local(view, point);
    return is_equirect(view) ? point_around(view, p) : point_ahead(view, p);
}

static inline ALWAYS_INLINE float2 project_unbranched(__global const float *restrict view, float3 point)
{
    const float3 p = view_rotate_to_local(view, point);
    const int equirect = is_equirect(view);
    const float2 around = point_around(view, p), ahead = point_ahead(view, p);
    return (float2)(projected(equirect, around.x, ahead.x), projected(equirect, around.y, ahead.y));
}

// Return the angle in radians of a pixel in direction d, the longer one of the two.
static inline ALWAYS_INLINE float pixel_angle(__global const float *restrict view, float3 d)
{
    return is_equirect(view) ? IPRT_PI / view[13] : -(view[2] * d.x + view[5] * d.y + view[8] * d.z) / view[9];
}
