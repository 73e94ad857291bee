// Motion vectors of reflections on virtual surfaces, while objects move. A mirror that moves shows the same point
// elsewhere on its surface. A rough one, or one that bends within a pixel, mixes many points: there, the history
// of the surface is the better one.
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top. World: +Y up, metres.
//
// in   guide, guide_previous  7 planes (guide.h); the border of `guide` wrapped in equirect views
//      motion                 2 planes: previous position of the surface, pixels; -1e9: nowhere
//      roughness              1 plane, GGX alpha
//      hit                    1 plane, distance to the reflected point, metres; negative: on an object, 0: no
//                             reflection
//      view                   lib/gbuffer/view.h, of the previous picture
//      camera                 lib/gbuffer/camera.h
// out  moved                  2 planes: previous position of the reflection, as `motion`
//
// The previous position is where the previous picture's normals mirror the view towards the same point, found by
// the method of Gauss and Newton from the surface's own position. A point on an object is taken to move with the
// surface: most are on the same object.
#include "gbuffer/camera.h"
#include "gbuffer/guide.h"
#include "gbuffer/view.h"

#define FAR_REFLECTION 1e6f
#define ITERATIONS 3
#define MOST_STEP 8.0f      // pixels per iteration
#define LAG_FRAMES 6.0f     // for which the surface's own history would lag behind the reflection
#define LOBE 8.0f           // squared angle that a lobe of alpha 1 covers

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

// The mirror that the previous picture shows at an image point.
typedef struct {
    float3 normal;
    float3 point; // of its tangent plane, on the ray through the image point
    bool found;
} Mirror;

// Return the mirror of object `id` at `at`. Normals are interpolated between pixels, as the position of an
// image far behind a curved surface is sensitive to them.
static inline Mirror mirror_before(
    __global const float *restrict view, __global const float *restrict guide, float id, float2 at, int width,
    int height, int seam)
{
    const int size = plane_size(width, height);
    const float2 corner = floor(at - 0.5f), part = at - 0.5f - corner;
    float3 normal = (float3)(0.0f), point = (float3)(0.0f);
    float weights = 0.0f;
    for (int i = 0; i < 4; i++) {
        const int q = pixel_at(corner + (float2)(i & 1, i >> 1) + 0.5f, width, height, seam);
        if (q < 0 || guide[GUIDE_ID * size + q] != id)
            continue;
        const float w = ((i & 1) ? part.x : 1.0f - part.x) * ((i >> 1) ? part.y : 1.0f - part.y);
        normal += w * guide_vector(guide, GUIDE_NORMAL, size, q);
        point += w * guide_vector(guide, GUIDE_POSITION, size, q);
        weights += w;
    }
    Mirror mirror;
    const float3 ray = view_direction(view, at);
    mirror.normal = safe_normalize(normal, -ray);
    const float facing = dot(mirror.normal, ray);
    mirror.found = weights > 0.2f && facing < -1e-3f;
    mirror.point = ray * (dot(mirror.normal, point) / (weights * facing));
    return mirror;
}

// Return how far the mirrored ray through `at` misses the direction to `reflected`.
static inline float3 mirror_error(__global const float *restrict view, Mirror mirror, float2 at, float3 reflected)
{
    const float3 ray = view_direction(view, at);
    return ray - 2.0f * dot(ray, mirror.normal) * mirror.normal - normalize(reflected - mirror.point);
}

// Return a step of Gauss and Newton towards the image point whose mirrored ray meets `reflected`; 0 where the
// error does not determine one.
static inline float2 mirror_step(
    __global const float *restrict view, __global const float *restrict guide, float id, float2 at, float3 error,
    float3 reflected, int width, int height, int seam)
{
    const float2 right = at + (float2)(1.0f, 0.0f), down = at + (float2)(0.0f, 1.0f);
    const Mirror a = mirror_before(view, guide, id, right, width, height, seam);
    const Mirror b = mirror_before(view, guide, id, down, width, height, seam);
    const float3 by_x = mirror_error(view, a, right, reflected) - error;
    const float3 by_y = mirror_error(view, b, down, reflected) - error;
    const float xx = dot(by_x, by_x), yy = dot(by_y, by_y), xy = dot(by_x, by_y);
    const float determinant = xx * yy - xy * xy, ex = dot(by_x, error), ey = dot(by_y, error);
    if (!a.found || !b.found || !(determinant > 1e-3f * xx * yy))
        return (float2)(0.0f);
    const float2 step = (float2)(xy * ey - yy * ex, xy * ex - xx * ey) / determinant;
    return step * fmin(1.0f, MOST_STEP / fmax(length(step), 1e-6f));
}

// Return the spread of mirrored rays within a pixel, as a squared angle: the normals' steps to its neighbours.
static inline float turned_within(__global const float *restrict guide, int size, int stride, int p)
{
    const float3 normal = guide_vector(guide, GUIDE_NORMAL, size, p);
    float turned = 0.0f;
    for (int i = 0; i < 4; i++) {
        const int q = p + (i < 2 ? 2 * i - 1 : (2 * i - 5) * stride);
        const float3 turn = guide_vector(guide, GUIDE_NORMAL, size, q) - normal;
        turned += guide[GUIDE_ID * size + q] == guide[GUIDE_ID * size + p] ? 0.5f * dot(turn, turn) : 0.0f;
    }
    return turned;
}

__kernel void move_reflections(
    __global const float *restrict guide,          // 7 planes
    __global const float *restrict guide_previous, // 7 planes
    __global const float *restrict motion,         // 2 planes
    __global const float *restrict roughness,      // 1 plane
    __global const float *restrict hit,            // 1 plane
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
    const Mirror own = mirror_before(view, guide_previous, id, surface, width, height, seam);
    if (!own.found || hit[p] == 0.0f)
        return;
    const float3 normal = guide_vector(guide, GUIDE_NORMAL, size, p);
    const float3 point = guide_vector(guide, GUIDE_POSITION, size, p), seen = normalize(point);
    float3 way = fmin(fabs(hit[p]), FAR_REFLECTION) * (seen - 2.0f * dot(seen, normal) * normal);
    float3 reflected = point + way;
    if (camera.rows) {
        reflected = camera_before(camera.rows, reflected, 1.0f);
        way = camera_before(camera.rows, way, 0.0f);
    }
    if (hit[p] < 0.0f)
        reflected = own.point + way;

    float2 at = surface;
    Mirror mirror = own;
    float3 error = mirror_error(view, mirror, at, reflected);
    const float missed = dot(error, error);
    float left = missed;
    for (int i = 0; i < ITERATIONS; i++) {
        const float2 step = mirror_step(view, guide_previous, id, at, error, reflected, width, height, seam);
        const float2 next = at + step;
        mirror = mirror_before(view, guide_previous, id, next, width, height, seam);
        error = mirror_error(view, mirror, next, reflected);
        if (!mirror.found || !(dot(error, error) < left))
            break;
        at = next;
        left = dot(error, error);
    }
    const float lag = LAG_FRAMES * LAG_FRAMES * missed;
    const float wide = LOBE * roughness[p] * roughness[p] + turned_within(guide, size, plane_stride(width), p);
    const float share = missed > 0.0f ? (1.0f - left / missed) * lag / (lag + wide) : 0.0f;
    float2 step = at - surface;
    if (seam)
        step.x -= width * floor(step.x / width + 0.5f);
    moved[p] = surface.x + share * step.x;
    moved[size + p] = surface.y + share * step.y;
}
