// Light that virtual surfaces reflect: IPRT Algorithm 1, lines 10-16. One BRDF sample a ray; the
// diffuse lobe is kept without its albedo, which compositing applies at full resolution.
//
// in   list, count    pixels to trace (y * width + x) and how many
//      guide          7 planes (lib/guide.h): world normal towards the viewer, position, id
//      albedo         3 planes
//      ratio          [H*W] E_RV / E_R of the view's real surfaces
//      real, objects  lib/scene.h
// out  diffuse        3 planes (-D HAS_DIFFUSE): irradiance / pi
//      specular       3 planes (-D HAS_SPECULAR): radiance
//      touched        1 plane: TOUCHED_FRAMES where a ray met an object
//      samples        1 plane: rays that the pixel has sent since the start, in and out
#include "path.h"
#include "planes.h"

TRACING_KERNEL void trace_virtual(
    const int width,
    const int height,
    const int rays,                              // per pixel
    const int frame_seed,
    __global const int *restrict list,
    __global const int *restrict count,
    __global const float *restrict guide,
    __global const float *restrict albedo,
    __global const float *restrict view,         // lib/view.h
    __global const float4 *restrict ratio,
    REAL_PARAMETERS,
    OBJECT_PARAMETERS,
    __global uint *restrict samples,
    __global float *restrict diffuse,
    __global float *restrict specular,
    __global float *restrict touched)
{
    const int item = get_global_id(0);
    if (item >= count[0])
        return;
    const World world = {REAL_LAYER, real_color,
#ifdef OPENING_ENVIRONMENT
                         real_outside,
#endif
#ifdef RELIT
                         ratio, width, height,
#endif
                         OBJECTS(view), materials};
    const int x = list[item] % width, y = list[item] / width;
    const int pixel = plane_index(x, y, width), size = plane_size(width, height);
    const float3 n = (float3)(guide[pixel], guide[size + pixel], guide[2 * size + pixel]);
    const float3 p = (float3)(guide[3 * size + pixel], guide[4 * size + pixel],
                              guide[5 * size + pixel]);
    const Material material = load_material(materials, (int)guide[6 * size + pixel] - 1);
    const float3 color = (float3)(albedo[pixel], albedo[size + pixel], albedo[2 * size + pixel]);
    const float distance = length(p);
#ifdef VIEW_EQUIRECT
    const float footprint = equirect_footprint;
#else
    const float footprint = screen_footprint;
#endif
    const float3 o = p + OBJECT_LIFT * footprint * distance * n;
    const float3 viewer = -p / distance;
    const uint seed = hash_combine(hash_combine((uint)list[item], 0x76697274u), (uint)frame_seed);

    float3 diffuse_sum = (float3)(0.0f), specular_sum = (float3)(0.0f);
    int met = 0;
    const uint first = samples[pixel];
    for (int ray = 0; ray < rays; ray++) {
        const uint index = first + ray;
        const float2 u = sobol_2d(index, seed);
        const BrdfSample sample =
            brdf_sample(material, color, n, viewer,
                        (float3)(u, sobol_1d(index, hash_combine(seed, 1))));
        if (!(sample.weight.x + sample.weight.y + sample.weight.z > 0.0f))
            continue;
#ifdef DISTANT_ENVIRONMENT
        const float3 radiance = sample.weight * sky_radiance(world, sample.wi);
#else
        const PathResult path = trace_path(world, o, o, sample.wi, seed, index);
        const float3 radiance = sample.weight * path.arriving;
        met |= path.met;
#endif
        if (sample.specular)
            specular_sum += radiance;
        else
            diffuse_sum += radiance;
    }
    samples[pixel] = first + rays;
#ifdef HAS_DIFFUSE
    const float3 diffuse_mean = diffuse_sum / (float)rays;
    diffuse[pixel] = diffuse_mean.x;
    diffuse[size + pixel] = diffuse_mean.y;
    diffuse[2 * size + pixel] = diffuse_mean.z;
#endif
#ifdef HAS_SPECULAR
    const float3 specular_mean = specular_sum / (float)rays;
    specular[pixel] = specular_mean.x;
    specular[size + pixel] = specular_mean.y;
    specular[2 * size + pixel] = specular_mean.z;
#endif
    if (met)
        touched[pixel] = TOUCHED_FRAMES;
}
