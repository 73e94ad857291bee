// Motion vectors of reflections on virtual surfaces, while objects move. A mirror shows a virtual image of the
// reflected point behind it, whose motion differs from the mirror's own. On rough surfaces the reflection moves
// with the surface.
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top. World: +Y up, metres.
//
// in   guide, guide_previous  7 planes (guide.h); the border of `guide` wrapped in equirect views
//      motion                 2 planes: previous position of the surface, pixels; -1e9: nowhere
//      roughness              1 plane, GGX alpha
//      hit                    1 plane, distance to the reflected point, metres; 0: no reflection
//      view                   lib/gbuffer/view.h, of the previous picture
//      camera                 lib/gbuffer/camera.h
// out  moved                  2 planes: previous position of the reflection, as `motion`
//
// The image of a point at distance h in front of a mirror of curvature k (convex: > 0) lies at
// I = h / (2 k h + 1) behind it (NVIDIA's ReLAX; the mirror equation at normal incidence). The motions of
// surface and image are blended by the share of a rough lobe that follows the mirror direction (Lagarde and
// de Rousiers, "Moving Frostbite to Physically Based Rendering", 2014, section 4.9.3).
#include "gbuffer/camera.h"
#include "gbuffer/guide.h"
#include "gbuffer/view.h"

#define FAR_REFLECTION 1e6f

static inline float3 guide_vector(__global const float *guide, int plane, int size, int p)
{
    return (float3)(guide[plane * size + p], guide[(plane + 1) * size + p],
                    guide[(plane + 2) * size + p]);
}

// Return the plane index of the pixel that contains an image point; -1 outside the picture.
static inline int pixel_at(float2 at, int width, int height, int seam)
{
    if (!(fabs(at.x) < 1e6f && at.y >= 0.0f && at.y < height))
        return -1;
    int column = wrap_column((int)floor(at.x), width, seam);
    return column >= 0 && column < width ? plane_index(column, (int)at.y, width) : -1;
}

__kernel void move_reflections(
    __global const float *restrict guide,          // 7 planes
    __global const float *restrict guide_previous, // 7 planes
    __global const float *restrict motion,         // 2 planes
    __global const float *restrict roughness,      // 1 plane
    __global const float *restrict hit,            // 1 plane, border wrapped
    __global const float *restrict view,           // of the previous picture
    __global float *restrict moved,                // out: 2 planes
    int width,
    int height,
    int seam,
    const Camera camera)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int size = plane_size(width, height), stride = plane_stride(width);
    int p = plane_index(x, y, width);
    float2 surface = (float2)(motion[p], motion[size + p]);
    moved[p] = surface.x;
    moved[size + p] = surface.y;
    float id = guide[GUIDE_ID * size + p];
    int before = pixel_at(surface, width, height, seam);
    if (!(id > 0.0f) || before < 0 || guide_previous[GUIDE_ID * size + before] != id)
        return;
    float3 normal = guide_vector(guide, GUIDE_NORMAL, size, p);
    float3 point = guide_vector(guide, GUIDE_POSITION, size, p);

    // Single distances are noisy. The harmonic mean of nine limits the influence of far ones.
    float nearness = 0.0f, count = 0.0f, bend = 0.0f, bends = 0.0f;
    for (int i = 0; i < 9; i++) {
        int q = p + i % 3 - 1 + (i / 3 - 1) * stride;
        if (guide[GUIDE_ID * size + q] != id)
            continue;
        if (hit[q] > 0.0f) {
            nearness += 1.0f / hit[q];
            count += 1.0f;
        }
        float3 step = guide_vector(guide, GUIDE_POSITION, size, q) - point;
        float3 turn = guide_vector(guide, GUIDE_NORMAL, size, q) - normal;
        bend += dot(turn, step);
        bends += dot(step, step);
    }
    if (!(count > 0.0f))
        return;
    float distance = fmin(count / fmax(nearness, 1e-30f), FAR_REFLECTION);
    float curvature = bends > 0.0f ? fmax(bend / bends, 0.0f) : 0.0f;
    float image = 1.0f / (2.0f * curvature * distance + 1.0f);

    // The surface point in the previous picture. The normal is interpolated between pixels, as the position
    // of an image far behind a curved surface is sensitive to it.
    float3 normal_before = (float3)(0.0f), near_before = (float3)(0.0f);
    float weights = 0.0f;
    float2 corner = floor(surface - 0.5f), part = surface - 0.5f - corner;
    for (int i = 0; i < 4; i++) {
        float2 at = corner + (float2)(i & 1, i >> 1) + 0.5f;
        int q = pixel_at(at, width, height, seam);
        if (q < 0 || guide_previous[GUIDE_ID * size + q] != id)
            continue;
        float w = ((i & 1) ? part.x : 1.0f - part.x) * ((i >> 1) ? part.y : 1.0f - part.y);
        normal_before += w * guide_vector(guide_previous, GUIDE_NORMAL, size, q);
        near_before += w * guide_vector(guide_previous, GUIDE_POSITION, size, q);
        weights += w;
    }
    near_before /= weights; // at least 1/4, as the nearest pixel shows the surface
    normal_before = safe_normalize(normal_before, normal);
    float3 ray = view_direction(view, surface);
    float facing = dot(normal_before, ray);
    if (!(facing < -1e-3f))
        return;
    float3 point_before = ray * (dot(normal_before, near_before) / facing);

    float3 seen = normalize(point);
    float3 mirrored = seen - 2.0f * dot(seen, normal) * normal;
    float3 reflected = point + distance * mirrored;
    if (camera.rows)
        reflected = camera_before(camera.rows, reflected, 1.0f);
    float3 behind = reflected
                    - 2.0f * dot(reflected - point_before, normal_before) * normal_before;
    float2 at = view_project(view, point_before + image * (behind - point_before));
    int there = pixel_at(at, width, height, seam);
    if (there < 0 || guide_previous[GUIDE_ID * size + there] != id)
        return;
    // At other points of a curved surface, the reflection is a different one.
    float agreement = dot(guide_vector(guide_previous, GUIDE_NORMAL, size, there), normal_before);
    float alike = clamp(10.0f * agreement - 9.0f, 0.0f, 1.0f);
    float rough = sqrt(clamp(roughness[p], 0.0f, 1.0f)), smooth = 1.0f - rough;
    float share = alike * smooth * (sqrt(smooth) + rough);
    float2 step = at - surface;
    if (seam)
        step.x -= width * floor(step.x / width + 0.5f);
    moved[p] = surface.x + share * step.x;
    moved[size + p] = surface.y + share * step.y;
}
