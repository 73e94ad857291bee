// No objects: rays meet nothing.
#pragma once

#include "world/objects/ray_cone.h"
#include "world/objects/scatterer.h"

#if defined(DISTANT_ENVIRONMENT) && !defined(OBJECTS_BVH)

typedef struct {
    float t;
} ObjectHit;

static inline int trace_objects(const Objects world, float3 o, float3 d, float t_max, int any, ObjectHit *hit)
{
    return 0;
}

// Never called.
static inline Scatterer object_point(const Objects world, const ObjectHit hit, float3 o, float3 d, RayCone cone)
{
    const Scatterer point = {o, -d, (float3)(0.0f), 0};
    return point;
}

static inline float object_lift(const Objects world, float distance)
{
    return 0.0f;
}

#endif
