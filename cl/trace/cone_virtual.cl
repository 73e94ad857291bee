// Reflected light of virtual surfaces, by cones. Directions are sampled by the BRDF, and apertures follow from
// the density of the samples: narrow where surfaces are smooth (M. Colbert and J. Krivanek, "GPU-Based
// Importance Sampling", GPU Gems 3, as K. Rohmer et al., "Natural Environment Illumination", section 7). The
// diffuse lobe is stored without albedo, which compositing applies at full resolution.
//
// in   list, count       pixels to trace (y * width + x) and how many
//      guide             7 planes (lib/gbuffer/guide.h): world normal towards the viewer, position, id
//      surfaces          planes of the visible surfaces
//      materials         lib/world/brdf.h
//      scene, objects    lib/trace/voxels.h
//      surroundings      lib/trace/prefiltered.h
//      delta             lib/trace/voxels.h (-D DELTA): the objects' change of real surfaces' radiance
// out  diffuse           3 planes (-D HAS_DIFFUSE): irradiance / pi
//      specular          3 planes (-D HAS_SPECULAR): radiance
//      hit               1 plane (-D HAS_SPECULAR): distance to the reflected surface, as in trace_virtual.cl
//      samples           1 plane: number of the pixel's cones since the start, in and out
//      touched           1 plane: TOUCHED_FRAMES where a cone hit an object
#include "trace/prefiltered.h"
#include "trace/sums.h"
#include "trace/surfaces.h"
#include "maths/sampling.h"
#include "maths/work_counters.h"
#include "world/brdf.h"

#define FAR_HIT 1e6f

TRACING_KERNEL void cone_virtual(
    const Pixels pixels,
    const Surfaces surfaces,
    __global const float4 *restrict materials,
    const Voxels scene,
    const Voxels objects,
    const Surroundings around,
    const int cones,
    __global uint *restrict samples,
    __global float *restrict diffuse,
    __global float *restrict specular,
    __global float *restrict hit_distance,
    __global float *restrict touched,
    const Work work)
{
    LIST_ITEM(pixels.count[0]);
    COUNT_ITEM;
    Sums diffuse_sum, specular_sum;
    clear_sums(diffuse_sum);
    clear_sums(specular_sum);
    volatile float lobe = 0.0f, lobe_nearness = 0.0f;
    int met = 0;
    for (int ray = 0; ray < pixels.rays; ray++) {
        const TracedPixel at = traced_pixel(pixels, item, 0x76636f6eu);
        const Material material = load_surface_material(
            materials, seen_material(surfaces, at), seen_finish(surfaces, at.size, at.pixel));
        const float3 color = load_traced(surfaces.albedo, at.size, at.pixel);
        const float3 viewer = -at.p / length(at.p);
        const uint index = READ_AGAIN(samples + at.pixel) + ray;
        const float2 u = sobol_2d(index, at.seed);
        const float choice = sobol_1d(index, hash_combine(at.seed, 1));
        const BrdfSample sample =
            brdf_sample(material, color, at.n, viewer, (float3)(u, choice));
        const float cosine = dot(at.n, sample.wi);
        if (!(cosine > 0.0f))
            continue;
        // A perfect mirror has a single direction and its weight, and no density.
        const int mirrored = is_mirrored(material, sample);
        float3 specular_share = mirrored ? sample.weight : (float3)(0.0f);
        float diffuse_share = 0.0f, solid_angle = 0.0f;
        if (!mirrored) {
            const BrdfValue value = brdf_eval(material, color, at.n, viewer, sample.wi);
            const float2 density = brdf_pdf(material, color, at.n, viewer, sample.wi);
            const float inverse = 1.0f / fmax(density.x + density.y, 1e-20f);
            diffuse_share = value.diffuse * cosine * inverse;
            specular_share = value.specular * cosine * inverse;
            solid_angle = inverse / cones;
        }
        Cone cone;
        cone.d = sample.wi;
        cone.rise = cosine;
        cone.slope = cone_slope(solid_angle);
        cone.lift = CONE_CLEARANCE * objects.box.w;
        cone.o = at.p + cone.lift * at.n;
        const ConeLight object = trace_cone(objects, cone, 0.0f, 0.0f, 1);
        cone.o = at.p;
        cone.lift = CONE_FAR;
        const ConeLight real = trace_cone(scene, cone, scene.box.w, 0.0f, 1);
        float3 behind = all_arriving(around, cone, real);
#ifdef DELTA
        const ConeLight change = trace_cone(around.delta, cone, around.delta.box.w, 0.0f, 1);
        behind = fmax(behind + change.radiance, 0.0f);
#endif
        const float3 arriving = object.radiance + object.passed * behind;
        met |= object.passed < 1.0f;
        add_to(diffuse_sum, diffuse_share * arriving);
        add_to(specular_sum, specular_share * arriving);
        const float away = object.passed < 0.5f ? object.distance
            : real.passed < 0.5f ? real.distance : FAR_HIT;
        lobe += luminance(specular_share);
        lobe_nearness += luminance(specular_share) / fmax(away, 1e-6f);
    }
    const TracedPixel at = traced_pixel(pixels, item, 0x76636f6eu);
    samples[at.pixel] += pixels.rays;
    if (diffuse)
        store_planes(diffuse, at.size, at.pixel, summed(diffuse_sum) / (float)pixels.rays);
    if (specular) {
        store_planes(specular, at.size, at.pixel, summed(specular_sum) / (float)pixels.rays);
        hit_distance[at.pixel] = lobe > 0.0f ? fmin(lobe / lobe_nearness, FAR_HIT) : 0.0f;
    }
    if (met)
        touched[at.pixel] = TOUCHED_FRAMES;
}
