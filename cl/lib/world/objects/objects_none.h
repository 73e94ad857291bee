// No objects that rays meet: the panorama is a distant environment (-D DISTANT_ENVIRONMENT).
#ifndef IPRT_OBJECTS_NONE_H
#define IPRT_OBJECTS_NONE_H

typedef struct {
    __global const float4 *bounds;       // 2 per object: corners of its box, world
    int objects;
} Objects;

static inline float object_lift(const Objects world, float distance)
{
    return 0.0f;
}

#define OBJECT_PARAMETERS __global const float4 *restrict objects_bounds, const int objects_count

#define OBJECTS(view) {objects_bounds, objects_count}

#endif
