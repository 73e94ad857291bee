// Parameters of kernels that trace the scene, and the structs built from them. The host sets them by name,
// in groups: `Panorama.arguments`, `Background.arguments`, `LearnedRadiance.arguments`,
// `Impostor.arguments`.
#ifndef IPRT_SCENE_H
#define IPRT_SCENE_H

#include "world/objects/objects.h"
#include "world/real/real.h"

#ifdef BACKGROUND
#define BACKGROUND_PARAMETERS                                                                      \
    , __global const float4 *restrict back_surface, __global const float2 *restrict back_range,    \
        __global const float *restrict back_color
#define BACKGROUND_LAYER , back_surface, back_range, back_color
#else
#define BACKGROUND_PARAMETERS
#define BACKGROUND_LAYER
#endif

#ifdef LEARNED_RADIANCE
#define REAL_LEARNED_PARAMETERS , LEARNED_PARAMETERS
#define REAL_LEARNED , LEARNED_OF_PARAMETERS
#else
#define REAL_LEARNED_PARAMETERS
#define REAL_LEARNED
#endif

#ifdef IMPOSTOR
#define REAL_IMPOSTOR_PARAMETERS , IMPOSTOR_PARAMETERS
#define REAL_IMPOSTOR , IMPOSTOR_OF_PARAMETERS
#else
#define REAL_IMPOSTOR_PARAMETERS
#define REAL_IMPOSTOR
#endif

#define REAL_PARAMETERS                                                                            \
    const int real_width, const int real_height, const int real_levels,                            \
        __global const float2 *restrict real_range, __global const float2 *restrict real_column,   \
        __global const float *restrict real_row, __global const float4 *restrict real_surface,     \
        const float real_thickness_m, const float real_thickness_ratio, const int real_back_faces, \
        const float real_bias, const float real_nearest, const float real_farthest,                \
        __global const float *restrict real_color,                                                 \
        __global const float *restrict real_outside BACKGROUND_PARAMETERS REAL_LEARNED_PARAMETERS  \
            REAL_IMPOSTOR_PARAMETERS

#define REAL_LAYER                                                                                 \
    {                                                                                              \
        {real_width, real_height, real_levels, real_range, real_column, real_row WORK},            \
            real_surface, real_thickness_m, real_thickness_ratio, real_back_faces, real_bias,      \
            real_nearest, real_farthest BACKGROUND_LAYER REAL_LEARNED REAL_IMPOSTOR                \
    }

#endif
