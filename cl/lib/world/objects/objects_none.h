// No objects: rays meet nothing.
#ifndef IPRT_OBJECTS_NONE_H
#define IPRT_OBJECTS_NONE_H

#include "world/objects/scatterer.h"

typedef struct {
    __global const float4 *bounds;       // 2 per object: corners of its box, world
    int objects;
} Objects;

typedef struct {
    float t;
} ObjectHit;

static inline int trace_objects(const Objects world, float3 o, float3 d, float t_max, ObjectHit *hit)
{
    return 0;
}

// Never called.
static inline Scatterer object_point(const Objects world, const ObjectHit hit, float3 o, float3 d)
{
    const Scatterer point = {o, -d, (float3)(0.0f), 0};
    return point;
}

static inline float object_lift(const Objects world, float distance)
{
    return 0.0f;
}

#define OBJECT_PARAMETERS __global const float4 *restrict objects_bounds, const int objects_count

#define OBJECTS(view) {objects_bounds, objects_count}

#endif
