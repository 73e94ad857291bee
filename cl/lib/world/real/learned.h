// Learned radiance of real surfaces: local linear models, W. Lee et al., "Online Illumination Learning for
// Interactive Global Illumination in Augmented Reality" (IEEE Access 2022).
//
// A model is MODEL_PARTS float4, in the axes of the world:
//   centre, bandwidth | normal, samples learned | radiance at the centre, sum of weights |
//   slope along the first tangent, sum of squared errors | along the second, 0
// Slopes are per search radius. Tangents are build_frame()'s.
//
// Models are kept in a uniform grid with cells as wide as the search radius. A cell lists the models that
// may reach it: those within the search radius. Its index in the table is its coordinates modulo the grid's
// size, so that the grid is unbounded: cells with the same index are far apart, and distances tell their
// models apart.
#pragma once

#include "maths/maths.h"
#include "maths/sampling.h"
#include <iprt.world.real.radiance_models>

#define MODEL_PARTS 5
#define SAMPLE_PARTS 3
// Cells of the table along each axis, powers of two.
#define GRID_X 32
#define GRID_Y 16
#define GRID_Z 32
// Least weight of a model that takes part, epsilon of section IV-A ...
#define LEAST_WEIGHT 0.1f
// ... and least cosine between the surface's normal and its own.
#define ALIKE_NORMAL 0.7f
// Samples that a model must have learned to be evaluated.
#define ASKED_FROM 8.0f

static inline float3 to_world(__global const float *pose, float3 v, float w)
{
    return (float3)(pose[0] * v.x + pose[1] * v.y + pose[2] * v.z + pose[3] * w,
                    pose[4] * v.x + pose[5] * v.y + pose[6] * v.z + pose[7] * w,
                    pose[8] * v.x + pose[9] * v.y + pose[10] * v.z + pose[11] * w);
}

// Return the coordinates of a point's cell; points that are not finite get some cell, too.
static inline int3 grid_cell(float3 p, float inverse_radius)
{
    return convert_int3_sat_rtn(p * inverse_radius);
}

static inline int grid_place(int3 cell)
{
    return ((cell.z & (GRID_Z - 1)) * GRID_Y + (cell.y & (GRID_Y - 1))) * GRID_X
        + (cell.x & (GRID_X - 1));
}

// Return the weight of a model at an offset of d from its centre (Eq. 3).
static inline float model_weight(float3 d, float bandwidth)
{
    return exp(-0.5f * dot(d, d) / (bandwidth * bandwidth));
}

// Return the weighted mean of the predictions of the models around p, in the world (Eq. 4), times the sum
// of their weights, which is the fourth. `greatest` gets the largest weight of any model there, evaluated
// or not.
static inline float4 ask_around(const Learned learned, float3 p, float3 n, float *greatest)
{
    const int place = grid_place(grid_cell(p, learned.inverse_radius));
    const int end = learned.start[place + 1];
    float4 sum = (float4)(0.0f);
    *greatest = 0.0f;
    for (int i = learned.start[place]; i < end; i++) {
        __global const float4 *model = learned.models + MODEL_PARTS * learned.list[i];
        const float4 centre = model[0], facing = model[1];
        const float3 d = p - centre.xyz;
        const float weight = model_weight(d, centre.w);
        if (!(weight >= LEAST_WEIGHT && dot(facing.xyz, n) >= ALIKE_NORMAL))
            continue;
        *greatest = fmax(*greatest, weight);
        if (facing.w < ASKED_FROM)
            continue;
        const Frame frame = build_frame(facing.xyz);
        const float x = dot(d, frame.x) * learned.inverse_radius;
        const float y = dot(d, frame.y) * learned.inverse_radius;
        const float3 predicted = model[2].xyz + x * model[3].xyz + y * model[4].xyz;
        sum += weight * (float4)(fmax(predicted, 0.0f), 1.0f);
    }
    return sum;
}

// Return the learned radiance at p with normal n, both in the axes of the capture centre; w: 1, or 0 where
// it is unknown.
static inline float4 learned_radiance(const Learned learned, float3 p, float3 n)
{
    float greatest;
    const float4 sum = ask_around(learned, to_world(learned.pose, p, 1.0f),
                                  to_world(learned.pose, n, 0.0f), &greatest);
    return sum.w > 0.0f ? (float4)(sum.xyz / sum.w, 1.0f) : (float4)(0.0f);
}
