// The surfaces that a view shows through dielectrics. At each surface the ray of a pixel's centre goes on to the side
// of the greater Fresnel term, as if the surface were smooth. Rough glass counts as opaque.
//
// in   guide   7 planes (lib/gbuffer/guide.h); id: 1 + material
//      surfaces  lib/trace/surfaces.h
//      world   lib/world/world.h
// out  seen    10 planes: lib/trace/seen_through.h
#include "gbuffer/guide.h"
#include "trace/seen_through.h"
#include "trace/surfaces.h"
#include "world/glass.h"
#include "world/world.h"

#define FARTHEST 1e6f
// Alpha of glass above which images in it are too blurred to be followed.
#define BLURRED 0.1f

TRACING_KERNEL void see_through(
    __global const float *restrict guide,
    const Surfaces surfaces,
    const World world,
    __global float *restrict seen,
    const int width,
    const int height,
    const int seam,
    const Work work)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int size = plane_size(width, height), pixel = plane_index(x, y, width);
    seen[SEEN_DISTANCE * size + pixel] = 0.0f;
    const int id = (int)guide[GUIDE_ID * size + pixel];
    if (id <= 0)
        return;
    COUNT_ITEM;
    const float3 p = load_planes(guide + GUIDE_POSITION * size, size, pixel);
    const float lift = object_lift(world.objects, length(p));
    Scatterer at;
    at.normal = at.plane = load_planes(guide, size, pixel);
    at.position = p + lift * at.normal;
    at.beyond = p - lift * at.normal;
    at.albedo = (float3)(1.0f);
    at.material = id - 1;
    at.finish = seen_finish(surfaces, size, pixel);
    at.enters = 1;
    const float3 view = normalize(p);
    float3 o = at.position, d = view - 2.0f * dot(view, at.normal) * at.normal;
    float distance = 0.0f, share = 1.0f;
    ulong media = 0;
    const RayCone cone = {0.0f, 0.0f};
    // The first ray is reflected, by the real scene alone.
    for (int i = 0; i < MOST_INTERFACES + 1; i++) {
        float3 o_object = o;
        ObjectHit hit;
        hit.t = INFINITY;
        int object = 0;
        if (i > 0) {
            Material material = load_surface_material(world.materials, at.material, at.finish);
            if (dielectric_share(material) < 0.5f || material.alpha > BLURRED) {
                distance = -distance;
                break;
            }
            material.alpha = 0.0f;
            const float3 side = (float3)(0.0f, 0.0f, 0.5f);
            const Scatter s = scatter_glass(world, material, at, -d, -1.0f, side, 0.0f, media, &o, &o_object);
            media = s.media;
            d = s.wi;
            object = trace_objects(world.objects, o_object, d, INFINITY, 0, &hit);
        }
        const RealHit real = trace_real_layer(world.real, o, d, object ? hit.t : INFINITY);
        const float radiance = luminance(pictured_radiance(world.real, real, d));
        if (i == 0) {
            Material material = load_surface_material(world.materials, at.material, at.finish);
            share = fresnel_dielectric(fabs(dot(view, at.normal)), material.ior);
            seen[SEEN_REFLECTED * size + pixel] = share * radiance;
            seen[SEEN_MIRRORED * size + pixel] = fmin(real.t, FARTHEST);
            d = view;
            continue;
        }
        o = o_object;
        distance = fmin(real.t, FARTHEST);
        seen[SEEN_REFRACTED * size + pixel] = (1.0f - share) * radiance;
        if (!object || real.t < hit.t - world.real.bias)
            break;
        distance = hit.t;
        at = object_point(world.objects, hit, o_object, d, cone);
    }
    store_planes(seen + SEEN_ORIGIN * size, size, pixel, o);
    store_planes(seen + SEEN_DIRECTION * size, size, pixel, d);
    seen[SEEN_DISTANCE * size + pixel] = distance;
}
