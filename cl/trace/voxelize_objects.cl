// Voxelization of the objects. Rays along the columns of one axis, SUB x SUB per column, mark the voxels that
// they pass inside of objects (a solid voxelization, as K. Rohmer et al., "Natural Environment Illumination",
// section 6.2), and the voxels of open surfaces.
//
// It is launched once per axis. Each work item is the only one that writes its column.
//
// in       objects      lib/world/objects/objects.h
//          levels, box  lib/trace/voxels.h; the box reaches at least a voxel beyond the objects
// in, out  opacity      of the finest level, along the axis; initially 0
//          surface      per voxel: sum of the albedos at hits, and number of hits
//          facing       per voxel: sum of the outward normals at hits
#include "world/objects/objects.h"
#include "maths/kernel_attributes.h"

// Rays along each side of a column.
#define SUB 2
// Most hits of a ray; surfaces beyond are ignored.
#define MOST_HITS 256
// Offset of the next ray segment behind a hit, in voxels.
#define BEYOND 1e-3f

static inline float3 turned(int axis, float along, float u, float v)
{
    return axis == 0 ? (float3)(along, u, v) : axis == 1 ? (float3)(v, along, u)
                                                         : (float3)(u, v, along);
}

TRACING_KERNEL void voxelize_objects(
    const Objects objects,
    const int axis,
    __global const int4 *restrict levels,
    const float4 box,
    __global float *restrict opacity,
    __global float4 *restrict surface,
    __global float4 *restrict facing,
    const Work work)
{
    const int4 size = levels[0];
    const int columns = axis == 0 ? size.y : axis == 1 ? size.z : size.x;
    const int rows = axis == 0 ? size.z : axis == 1 ? size.x : size.y;
    const int depth = axis == 0 ? size.x : axis == 1 ? size.y : size.z;
    const int stride = axis == 0 ? 1 : axis == 1 ? size.x : size.x * size.y;
    const int u = get_global_id(0), v = get_global_id(1);
    if (u >= columns || v >= rows)
        return;
    const float3 first = turned(axis, 0.0f, (float)u, (float)v);
    const int column = ((int)first.z * size.y + (int)first.y) * size.x + (int)first.x;
    const float3 d = turned(axis, 1.0f, 0.0f, 0.0f);
    for (int sub = 0; sub < SUB * SUB; sub++) {
        const float3 start = turned(axis, 0.0f, u + (sub % SUB + 0.5f) / SUB,
                                    v + (sub / SUB + 0.5f) / SUB);
        const float3 o = box.xyz + box.w * start;
        float at = 0.0f, entered = -1.0f;
        int free = 0;
        for (int i = 0; i < MOST_HITS; i++) {
            ObjectHit hit;
            hit.t = INFINITY;
            const int met =
                trace_objects(objects, o + box.w * at * d, d, (depth - at) * box.w, 0, &hit);
            float to = entered;
            int leaving = 0;
            if (met) {
                at += hit.t / box.w;
                const RayCone cone = {box.w / SUB, 0.0f};
                const ObjectSurface seen = object_surface(objects, hit, d, cone);
                leaving = dot(seen.normal, seen.flat_normal) < 0.0f;
                const int voxel = column + clamp((int)at, 0, depth - 1) * stride;
                const float3 albedo = object_albedo(objects, seen);
                surface[voxel] += (float4)(albedo, 1.0f);
                facing[voxel] += (float4)(seen.normal, 0.0f);
                to = leaving ? at : entered;
            }
            float from = entered >= 0.0f ? entered : leaving ? at : -1.0f;
            if (from >= 0.0f) {
                // Interpolation makes a single layer transparent: at least two are filled, for sheets too.
                if (to - from < 1.0f && leaving)
                    from = to - 1.0f;
                else if (to - from < 1.0f)
                    to = from + 1.0f;
                const int last = clamp((int)to, 0, depth - 1);
                for (int k = max((int)from, free); k <= last; k++)
                    opacity[4 * (column + k * stride) + axis] += 1.0f / (SUB * SUB);
                free = max(free, last + 1);
            }
            if (!met)
                break;
            entered = leaving ? -1.0f : at;
            at += BEYOND;
        }
    }
}
