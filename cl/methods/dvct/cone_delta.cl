// Change of the irradiance of real surfaces by the objects (T. A. Franke, "Delta Voxel Cone Tracing", section
// 3.2), relative to their irradiance E_R without objects. Cones towards the lights give the direct light that
// objects block (Eq. 2). Cones that fill the hemisphere give the objects' radiance and the antiradiance of the
// real surfaces around them (Eq. 6).
//
// The hemisphere is filled by `cones` cones with equal shares of the cosine: one along the normal, the others in
// a ring around it that turns from frame to frame. A frame traces `rays` of them, and as many towards lights,
// which are chosen in proportion to their irradiance.
//
// in   list, count       pixels to trace (y * width + x) and how many
//      guide             7 planes (lib/gbuffer/guide.h): world normal, position, id
//      object, delta     lib/trace/voxels.h
//      area_lights       area_lights.h
//      cache             lib/world/real/irradiance.h
// out  signal            6 planes: blocked / E_R rgb, bounce / E_R rgb
//      samples           1 plane: number of frames in which the pixel was traced, in and out
//      touched           1 plane: TOUCHED_FRAMES where a cone hit an object
#include "area_lights.h"
#include "trace/traced.h"
#include "trace/voxels.h"
#include "maths/work_counters.h"
#include "world/real/irradiance.h"

// Width of a cone relative to the light, at a random point of which it is aimed in each frame. Cones as wide as
// the light make shadows too dark.
#define CONE_SHARE 0.2f

TRACING_KERNEL void cone_delta(
    const Pixels pixels,
    const Voxels objects,
    const Voxels delta,
    const AreaLights lights,
    const IrradianceCache cache,
    const int cones,
    __global uint *restrict samples,
    __global float *restrict signal,
    __global float *restrict touched,
    const Work work)
{
    LIST_ITEM(pixels.count[0]);
    COUNT_ITEM;
    const TracedPixel at = traced_pixel(pixels, item, 0x64656c74u);
    float3 hidden = (float3)(0.0f), sent = (float3)(0.0f);
    int met = 0;
    const uint first = samples[at.pixel];
    const float2 u = sobol_2d(first, at.seed);
    const int above = voxels_above(objects, at.p, at.n);
    Cone cone;
    cone.o = at.p;

    float total = 0.0f;
    for (int number = 0; number < (above ? lights.count : 0); number++)
        total += luminance(light_irradiance(area_light(lights.rows, number), at.p, at.n));
    const float pace = total > 0.0f ? pixels.rays / total : 0.0f;
    float before = u.x;
    for (int number = 0; number < (pace > 0.0f ? lights.count : 0); number++) {
        const AreaLight light = area_light(lights.rows, number);
        const float3 arriving = light_irradiance(light, at.p, at.n);
        const float after = before + pace * luminance(arriving);
        const float chosen = floor(after) - floor(before);
        const float expected = after - before;
        before = after;
        if (!(chosen > 0.0f))
            continue;
        const float3 away = light.position - at.p;
        const float squared = dot(away, away);
        const float wide = sqrt(light.squared_radius / fmax(squared, 1e-12f));
        const float2 v = sobol_2d(first, hash_combine(at.seed, number + 1));
        const float2 off = fmin(wide, MOST_SLOPE) * sqrt(v.y) * unit_circle(v.x);
        const float3 axis = away * rsqrt(squared);
        cone.d = frame_to_world(build_frame(axis), (float3)(off.x, off.y, 1.0f));
        cone.d /= length(cone.d);
        cone.rise = dot(cone.d, at.n);
        cone.slope = CONE_SHARE * fmin(wide, MOST_SLOPE);
        // The surface is no part of the objects' voxels: the cone needs no clearance.
        cone.lift = CONE_FAR;
        const float passed = trace_cone(objects, cone, 0.0f, 0.0f, 0).passed;
        if (!(passed < 1.0f))
            continue;
        met = 1;
        hidden += chosen / expected * (1.0f - passed)
            * light_passing(lights, number, light, at.p, VOXEL_SLACK * objects.box.w).x * arriving;
    }

    for (int ray = 0; ray < (voxels_above(delta, at.p, at.n) ? pixels.rays : 0); ray++) {
        const float turn = (ray + u.y) / pixels.rays * cones;
        // Sine of the angle to the normal at the middle of a share: of the cap, or of the ring.
        const float radius = turn < 1.0f ? 0.0f : sqrt(0.5f + 0.5f / cones);
        const float2 around = radius * unit_circle(fmax(turn - 1.0f, 0.0f) / (cones - 1));
        cone.rise = sqrt(1.0f - radius * radius);
        cone.d = frame_to_world(build_frame(at.n), (float3)(around.x, around.y, cone.rise));
        cone.slope = cone_slope(IPRT_PI / (cones * cone.rise));
        cone.lift = CONE_FAR;
        const ConeLight object = trace_cone(objects, cone, 0.0f, 0.0f, 1);
        cone.lift = 0.0f;
        const float start = CONE_CLEARANCE * delta.box.w / fmax(cone.rise, LEAST_RISE);
        const int stopped = object.passed < 1.0f;
        const ConeLight less =
            trace_cone(delta, cone, start, stopped ? object.distance : 0.0f, 1);
        hidden -= object.passed / pixels.rays * less.radiance;
        sent += less.front / pixels.rays * object.radiance;
        met |= stopped;
    }
    samples[at.pixel] = first + 1;
    const float3 scale = inverse_irradiance(cache, at.p, at.n);
    store_signal(signal, at, scale, hidden, sent);
    if (met)
        touched[at.pixel] = TOUCHED_FRAMES;
}
