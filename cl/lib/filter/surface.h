// The surface that a pixel shows, to be found in the previous picture. -D CAMERA_MOTION:
// gbuffer/camera.h.
#pragma once

#include "gbuffer/camera.h"
#include "gbuffer/guide.h"
#include "maths/kernel_attributes.h"

typedef struct {
    float nx, ny, nz;   // normal and position in the axes of the previous picture
    float px, py, pz;
    float id;
    float tolerance;    // distance of one surface from its tangent plane
} Surface;

// The surface of pixel p. `plane_tolerance`: distance from its plane / depth.
static inline ALWAYS_INLINE Surface surface_before(
    __global const float *restrict guide, float plane_tolerance, int size, int p, const Camera camera)
{
    Surface s = {guide[p], guide[size + p], guide[2 * size + p],
                 guide[3 * size + p], guide[4 * size + p], guide[5 * size + p],
                 guide[GUIDE_ID * size + p], 0.0f};
    s.tolerance = plane_tolerance * sqrt(s.px * s.px + s.py * s.py + s.pz * s.pz);
    if (camera.rows) {
        const float3 normal = camera_before(camera.rows, (float3)(s.nx, s.ny, s.nz), 0.0f);
        const float3 point = camera_before(camera.rows, (float3)(s.px, s.py, s.pz), 1.0f);
        s.nx = normal.x, s.ny = normal.y, s.nz = normal.z;
        s.px = point.x, s.py = point.y, s.pz = point.z;
    }
    return s;
}

// Does pixel q of the previous picture show it? `normal_agreement`: least cosine between its normals.
static inline ALWAYS_INLINE bool shows_surface(
    __global const float *restrict guide_previous, const Surface s, float normal_agreement, int size,
    int q)
{
    float cosine = s.nx * guide_previous[q] + s.ny * guide_previous[size + q]
                   + s.nz * guide_previous[2 * size + q];
    float off_plane = s.nx * (guide_previous[3 * size + q] - s.px)
                      + s.ny * (guide_previous[4 * size + q] - s.py)
                      + s.nz * (guide_previous[5 * size + q] - s.pz);
    return guide_previous[GUIDE_ID * size + q] == s.id && fabs(off_plane) <= s.tolerance
           && cosine >= normal_agreement;
}
