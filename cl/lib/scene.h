// Parameters of kernels that trace the scene, and the structs made of them. The host passes them
// in this order (iprt/passes/trace.py).
#ifndef IPRT_SCENE_H
#define IPRT_SCENE_H

#include "objects.h"
#include "real.h"

#define REAL_PARAMETERS                                                                            \
    const int real_width, const int real_height, const int real_levels,                            \
        __global const float2 *restrict real_range, __global const float2 *restrict real_column,   \
        __global const float *restrict real_row, __global const float4 *restrict real_surface,     \
        const float real_thickness_m, const float real_thickness_ratio, const float real_bias,     \
        const float real_nearest, const float real_farthest,                                       \
        __global const float4 *restrict real_color, __global const float4 *restrict real_outside

#define REAL_LAYER                                                                                 \
    {                                                                                              \
        {real_width, real_height, real_levels, real_range, real_column, real_row}, real_surface,   \
            real_thickness_m, real_thickness_ratio, real_bias, real_nearest, real_farthest         \
    }

#define LAYER_PARAMETERS(name)                                                                     \
    const int name##_width, const int name##_height, const int name##_levels,                      \
        const float name##_footprint, __global const float2 *restrict name##_range,                \
        __global const float2 *restrict name##_column, __global const float *restrict name##_row,  \
        __global const float4 *restrict name##_planes,                                             \
        __global const float4 *restrict name##_geometry,                                           \
        __global const float4 *restrict name##_material

#define LAYER(name)                                                                                \
    {                                                                                              \
        {name##_width, name##_height, name##_levels, name##_range, name##_column, name##_row},     \
            name##_planes, name##_geometry, name##_material, name##_footprint                      \
    }

#define OBJECT_PARAMETERS                                                                          \
    LAYER_PARAMETERS(screen), LAYER_PARAMETERS(equirect), const int4 objects_rectangle,            \
        __global const float4 *restrict objects_bounds, const int objects_count,                   \
        __global const float4 *restrict materials

#define OBJECTS(view)                                                                              \
    {LAYER(screen), LAYER(equirect), view, objects_rectangle, objects_bounds, objects_count}

#endif
