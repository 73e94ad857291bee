// Motion vectors of the changes that moving objects make to real surfaces. Shadows and reflections move along with
// the object that causes them, over surfaces that stand still.
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top. World: +Y up, metres.
//
// in   guide, guide_previous  7 planes (guide.h)
//      motion                 2 planes: previous position of the surface, pixels; -1e9: nowhere
//      bounds, bounds_before  corners of the objects' boxes (boxes.h), in this picture and the previous one
//      view                   lib/gbuffer/view.h, of the previous picture
//      camera                 lib/gbuffer/camera.h
// out  carried                2 planes: previous position of the change, as `motion`
//
// Near an object, a change is a function of the position relative to it, as far as the surface is flat and the
// light comes from afar. So it was seen where the surface point lay that had the same place relative to the
// object: a step along the surface. (Zeng et al., "Temporally Reliable Motion Vectors for Real-time Ray Tracing",
// Computer Graphics Forum 40(2), 2021, section 4.1, follow the shadow of a point light likewise.) Several objects
// count by the square of the solid angle of their spheres. Where the previous picture did not show the surface
// there, the motion remains the surface's own.
#include "filter/surface.h"
#include "gbuffer/view.h"

// Return the weight of an object with the given box for a surface point.
static inline float closeness(float3 low, float3 high, float3 p)
{
    const float3 half_size = 0.5f * (high - low), off = fmax(fabs(0.5f * (low + high) - p) - half_size, 0.0f);
    const float size = dot(half_size, half_size), angle = size / (dot(off, off) + 0.01f * size + 1e-20f);
    return angle * angle;
}

__kernel void carry_changes(
    __global const float *restrict guide,          // 7 planes
    __global const float *restrict guide_previous, // 7 planes
    __global const float *restrict motion,         // 2 planes
    __global const float4 *restrict bounds,        // 2 per object
    __global const float4 *restrict bounds_before, // 2 per object
    __global const float *restrict view,           // of the previous picture
    __global float *restrict carried,              // out: 2 planes
    const int objects,
    const float plane_tolerance,                   // distance / depth of one surface
    const float normal_agreement,                  // least cosine between its normals
    int width,
    int height,
    int seam,
    const Camera camera)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int size = plane_size(width, height), p = plane_index(x, y, width);
    carried[p] = motion[p];
    carried[size + p] = motion[size + p];
    const Surface surface = surface_before(guide, plane_tolerance, size, p, camera);
    if (!(surface.id > 0.0f))
        return;
    const float3 own = (float3)(guide[3 * size + p], guide[4 * size + p], guide[5 * size + p]);
    const float3 point = (float3)(surface.px, surface.py, surface.pz);
    const float3 normal = (float3)(surface.nx, surface.ny, surface.nz);
    float3 step = (float3)(0.0f);
    float weights = 0.0f;
    for (int i = 0; i < objects; i++) {
        const float3 low = bounds[2 * i].xyz, high = bounds[2 * i + 1].xyz;
        float3 middle = 0.5f * (low + high);
        if (camera.rows)
            middle = camera_before(camera.rows, middle, 1.0f);
        const float weight = closeness(low, high, own);
        step += weight * (middle - 0.5f * (bounds_before[2 * i].xyz + bounds_before[2 * i + 1].xyz));
        weights += weight;
    }
    step /= fmax(weights, 1e-30f);
    step -= dot(step, normal) * normal;
    const float2 at = view_project(view, point - step);
    if (!(fabs(at.x) < 1e6f && at.y >= 0.0f && at.y < height))
        return;
    const int column = wrap_column((int)floor(at.x), width, seam);
    if (column < 0 || column >= width
        || !shows_surface(guide_previous, surface, normal_agreement, size, plane_index(column, (int)at.y, width)))
        return;
    carried[p] = at.x;
    carried[size + p] = at.y;
}
