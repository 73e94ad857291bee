// Motion vectors of reflections on virtual surfaces, and of refracted images in dielectrics, while objects move. A
// mirror or a glass that moves shows the same point elsewhere on its surface. A rough one, or one that bends within a
// pixel, mixes many points: there, the history of the surface is the better one.
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top. World: +Y up, metres.
//
// in   guide, guide_previous  7 planes (guide.h); the border of `guide` wrapped in equirect views
//      motion                 2 planes: previous position of the surface, pixels; -1e9: nowhere
//      roughness              1 plane, GGX alpha
//      hit                    1 plane, distance to the reflected point, metres; negative: on an object, 0: no
//                             reflection
//      seen, seen_previous    10 planes (lib/trace/seen_through.h) with -D GLASS, else null: reflections alone
//      view                   lib/gbuffer/view.h, of the previous picture
//      camera                 lib/gbuffer/camera.h
// out  moved                  2 planes: previous position of the reflection, as `motion`
//
// The previous position is where the previous picture's normals mirror the view towards the same point, or its glass
// refracted the view towards it. It is found by the method of Gauss and Newton from the surface's own position. A point
// on an object is taken to move with the surface: most are on the same object.
#include "gbuffer/camera.h"
#include "gbuffer/guide.h"
#include "gbuffer/view.h"
#include "trace/seen_through.h"

#define FAR_REFLECTION 1e6f
#define ITERATIONS 3
#define MOST_STEP 8.0f      // pixels per iteration
#define LAG_FRAMES 6.0f     // for which the surface's own history would lag behind the reflection
#define CONTRAST_STEP 3     // pixels between the values whose contrast counts
#define LEAST_CONTRAST 0.25f // of a refracted image that counts, as a share of the luminance
#define REFLECTIONS 4.0f    // contrast of all reflections on a glass, relative to the first surface's: squared
#define LOBE 8.0f           // squared angle that a lobe of alpha 1 covers

static inline float3 planes_at(__global const float *planes, int first, int size, int p)
{
    return (float3)(planes[first * size + p], planes[(first + 1) * size + p], planes[(first + 2) * size + p]);
}

// Return the plane index of the pixel that contains an image point; -1 outside the picture.
static inline int pixel_at(float2 at, int width, int height, int seam)
{
    if (!(fabs(at.x) < 1e6f && at.y >= 0.0f && at.y < height))
        return -1;
    int column = wrap_column((int)floor(at.x), width, seam);
    return column >= 0 && column < width ? plane_index(column, (int)at.y, width) : -1;
}

// The ray along which the previous picture sees a point by way of an object.
typedef struct {
    float3 origin;    // on the tangent plane of a mirror, or where the ray leaves the glass
    float3 direction;
    bool found;
} SeenRay;

// Return the ray of object `id` at `at`: reflected, or with `seen` refracted. Normals and rays are interpolated between
// pixels, as the position of an image far behind a curved surface is sensitive to them.
static inline SeenRay ray_before(
    __global const float *restrict view, __global const float *restrict guide, __global const float *restrict seen,
    float id, float2 at, int width, int height, int seam)
{
    const int size = plane_size(width, height);
    const float2 corner = floor(at - 0.5f), part = at - 0.5f - corner;
    float3 normal = (float3)(0.0f), point = (float3)(0.0f);
    float weights = 0.0f;
    for (int i = 0; i < 4; i++) {
        const int q = pixel_at(corner + (float2)(i & 1, i >> 1) + 0.5f, width, height, seam);
        if (q < 0 || guide[GUIDE_ID * size + q] != id || (seen && seen[SEEN_DISTANCE * size + q] == 0.0f))
            continue;
        const float w = ((i & 1) ? part.x : 1.0f - part.x) * ((i >> 1) ? part.y : 1.0f - part.y);
        normal += w * (seen ? planes_at(seen, SEEN_DIRECTION, size, q) : planes_at(guide, GUIDE_NORMAL, size, q));
        point += w * (seen ? planes_at(seen, SEEN_ORIGIN, size, q) : planes_at(guide, GUIDE_POSITION, size, q));
        weights += w;
    }
    SeenRay found;
    const float3 ray = view_direction(view, at);
    found.found = weights > 0.2f;
    if (seen) {
        found.origin = point / fmax(weights, 1e-6f);
        found.direction = safe_normalize(normal, ray);
        return found;
    }
    normal = safe_normalize(normal, -ray);
    const float facing = dot(normal, ray);
    found.found = found.found && facing < -1e-3f;
    found.origin = ray * (dot(normal, point) / (weights * facing));
    found.direction = ray - 2.0f * dot(ray, normal) * normal;
    return found;
}

// Return how far a ray misses the direction to `point`.
static inline float3 missed_by(SeenRay ray, float3 point) { return ray.direction - normalize(point - ray.origin); }

// Return a step of Gauss and Newton towards the image point whose ray meets `point`; 0 where the error does not
// determine one.
static inline float2 step_towards(
    __global const float *restrict view, __global const float *restrict guide, __global const float *restrict seen,
    float id, float2 at, float3 error, float3 point, int width, int height, int seam)
{
    const float2 right = at + (float2)(1.0f, 0.0f), down = at + (float2)(0.0f, 1.0f);
    const SeenRay a = ray_before(view, guide, seen, id, right, width, height, seam);
    const SeenRay b = ray_before(view, guide, seen, id, down, width, height, seam);
    const float3 by_x = missed_by(a, point) - error, by_y = missed_by(b, point) - error;
    const float xx = dot(by_x, by_x), yy = dot(by_y, by_y), xy = dot(by_x, by_y);
    const float determinant = xx * yy - xy * xy, ex = dot(by_x, error), ey = dot(by_y, error);
    if (!a.found || !b.found || !(determinant > 1e-3f * xx * yy))
        return (float2)(0.0f);
    const float2 step = (float2)(xy * ey - yy * ex, xy * ex - xx * ey) / determinant;
    return step * fmin(1.0f, MOST_STEP / fmax(length(step), 1e-6f));
}

// Return the spread within a pixel of three planes of unit vectors, as a squared angle: their steps to its neighbours.
static inline float turned_within(
    __global const float *restrict guide, __global const float *restrict planes, int plane, int size, int stride, int p)
{
    const float3 own = planes_at(planes, plane, size, p);
    float turned = 0.0f;
    for (int i = 0; i < 4; i++) {
        const int q = p + (i < 2 ? 2 * i - 1 : (2 * i - 5) * stride);
        const float3 turn = planes_at(planes, plane, size, q) - own;
        turned += guide[GUIDE_ID * size + q] == guide[GUIDE_ID * size + p] ? 0.5f * dot(turn, turn) : 0.0f;
    }
    return turned;
}

// Return the share of the contrast around a pixel that its refracted image has; reflections have the rest.
static inline float refracted_contrast(
    __global const float *restrict guide, __global const float *restrict seen, int size, int stride, int p)
{
    const float refracted = seen[SEEN_REFRACTED * size + p], reflected = seen[SEEN_REFLECTED * size + p];
    const float least = LEAST_CONTRAST * (refracted + reflected);
    float of_refracted = 0.0f, of_reflected = 0.0f;
    for (int i = 0; i < 25; i++) {
        const int q = p + CONTRAST_STEP * (i % 5 - 2 + (i / 5 - 2) * stride);
        if (guide[GUIDE_ID * size + q] != guide[GUIDE_ID * size + p])
            continue;
        const float a = seen[SEEN_REFRACTED * size + q] - refracted, b = seen[SEEN_REFLECTED * size + q] - reflected;
        of_refracted += a * a;
        of_reflected += REFLECTIONS * b * b + least * least;
    }
    return of_refracted / fmax(of_refracted + of_reflected, 1e-30f);
}

__kernel void move_reflections(
    __global const float *restrict guide,          // 7 planes
    __global const float *restrict guide_previous, // 7 planes
    __global const float *restrict motion,         // 2 planes
    __global const float *restrict roughness,      // 1 plane
    __global const float *restrict hit,            // 1 plane
    __global const float *restrict seen,           // 10 planes
    __global const float *restrict seen_previous,  // 10 planes
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
#ifdef GLASS
    const int glass = seen[SEEN_DISTANCE * size + p] != 0.0f;
#else
    const int glass = 0;
#endif
    const int through = glass && refracted_contrast(guide, seen, size, stride, p) > 0.5f;
    __global const float *through_before = through ? seen_previous : 0;
    const SeenRay own = ray_before(view, guide_previous, through_before, id, surface, width, height, seam);
    const float away = glass ? seen[(through ? SEEN_DISTANCE : SEEN_MIRRORED) * size + p] : hit[p];
    if (!own.found || away == 0.0f)
        return;
    const float3 normal = planes_at(guide, GUIDE_NORMAL, size, p);
    const float3 point = planes_at(guide, GUIDE_POSITION, size, p), ray = normalize(point);
    const float3 origin = through ? planes_at(seen, SEEN_ORIGIN, size, p) : point;
    float3 way = through ? planes_at(seen, SEEN_DIRECTION, size, p) : ray - 2.0f * dot(ray, normal) * normal;
    way *= fmin(fabs(away), FAR_REFLECTION);
    float3 target = origin + way;
    if (camera.rows) {
        target = camera_before(camera.rows, target, 1.0f);
        way = camera_before(camera.rows, way, 0.0f);
    }
    if (away < 0.0f)
        target = own.origin + way;

    float2 at = surface;
    SeenRay seen_ray = own;
    float3 error = missed_by(seen_ray, target);
    const float missed = dot(error, error);
    float left = missed;
    for (int i = 0; i < ITERATIONS; i++) {
        const float2 step
            = step_towards(view, guide_previous, through_before, id, at, error, target, width, height, seam);
        const float2 next = at + step;
        seen_ray = ray_before(view, guide_previous, through_before, id, next, width, height, seam);
        error = missed_by(seen_ray, target);
        if (!seen_ray.found || !(dot(error, error) < left))
            break;
        at = next;
        left = dot(error, error);
    }
    const float lag = LAG_FRAMES * LAG_FRAMES * missed;
    const float turned = through ? turned_within(guide, seen, SEEN_DIRECTION, size, stride, p)
                                 : turned_within(guide, guide, GUIDE_NORMAL, size, stride, p);
    const float wide = LOBE * roughness[p] * roughness[p] + turned;
    const float share = missed > 0.0f ? (1.0f - left / missed) * lag / (lag + wide) : 0.0f;
    float2 step = at - surface;
    if (seam)
        step.x -= width * floor(step.x / width + 0.5f);
    moved[p] = surface.x + share * step.x;
    moved[size + p] = surface.y + share * step.y;
}
