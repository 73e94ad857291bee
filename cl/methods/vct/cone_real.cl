// Change of the irradiance of real surfaces by the objects, by cones (K. Rohmer et al., "Natural Environment
// Illumination", Eqs. 4 to 6), relative to their irradiance E_R without objects. In each cone, the objects'
// radiance replaces the share of the incident radiance that they block.
//
// Cones are distributed by the cosine. Their aperture is such that `cones` of them fill the hemisphere; a frame
// traces `rays` of them.
//
// in   list, count       pixels to trace (y * width + x) and how many
//      guide             7 planes (lib/gbuffer/guide.h): world normal, position, id
//      scene, objects    lib/trace/voxels.h
//      surroundings      lib/trace/prefiltered.h
//      cache             lib/world/real/irradiance.h
// out  signal            6 planes: blocked / E_R rgb, bounce / E_R rgb
//      samples           1 plane: number of the pixel's cones since the start, in and out
//      touched           1 plane: TOUCHED_FRAMES where a cone hit an object
#include "trace/prefiltered.h"
#include "trace/traced.h"
#include "maths/sampling.h"
#include "maths/work_counters.h"
#include "world/real/irradiance.h"

TRACING_KERNEL void cone_real(
    const Pixels pixels,
    const Voxels scene,
    const Voxels objects,
    const Surroundings around,
    const IrradianceCache cache,
    const int cones,
    __global uint *restrict samples,
    __global float *restrict signal,
    __global float *restrict touched,
    const Work work)
{
    LIST_ITEM(pixels.count[0]);
    COUNT_ITEM;
    const TracedPixel at = traced_pixel(pixels, item, 0x636f6e65u);
    float3 hidden = (float3)(0.0f), sent = (float3)(0.0f);
    int met = 0;
    const uint first = samples[at.pixel];
    const int traced = voxels_above(objects, at.p, at.n) ? pixels.rays : 0;
    for (int ray = 0; ray < traced; ray++) {
        Cone cone;
        cone.o = at.p;
        cone.d = frame_to_world(build_frame(at.n), sample_cosine(sobol_2d(first + ray, at.seed)));
        cone.rise = fmax(dot(cone.d, at.n), 1e-3f);
        cone.slope = cone_slope(IPRT_PI / (cones * cone.rise));
        // The surface is no part of the objects' voxels: the cone needs no clearance.
        cone.lift = CONE_FAR;
        const ConeLight object = trace_cone(objects, cone, 0.0f, 0.0f, 1);
        if (!(object.passed < 1.0f))
            continue;
        met = 1;
        cone.lift = 0.0f;
        const float start = CONE_CLEARANCE * scene.box.w / fmax(cone.rise, LEAST_RISE);
        const ConeLight real = trace_cone(scene, cone, start, object.distance, 1);
        hidden += (1.0f - object.passed) * all_arriving(around, cone, real);
        sent += real.front * object.radiance;
    }
    samples[at.pixel] = first + pixels.rays;
    const float3 scale = inverse_irradiance(cache, at.p, at.n) / (float)pixels.rays;
    store_signal(signal, at, scale, hidden, sent);
    if (met)
        touched[at.pixel] = TOUCHED_FRAMES;
}
