// Motion of the 360° camera: `rows` of the block Camera (iprt/gbuffer/guide.py) are the rows (3 x 4 floats)
// of the affine map from the axes of this frame's capture centre to the previous frame's, or null.
#pragma once

#include <iprt.gbuffer.guide>

// Return w times the previous position of the point v / w; with w = 0, the previous direction of the
// infinitely distant direction v.
static inline float3 camera_before(__global const float *restrict camera, float3 v, float w)
{
    return (float3)(camera[0] * v.x + camera[1] * v.y + camera[2] * v.z + camera[3] * w,
                    camera[4] * v.x + camera[5] * v.y + camera[6] * v.z + camera[7] * w,
                    camera[8] * v.x + camera[9] * v.y + camera[10] * v.z + camera[11] * w);
}

// Return the current direction of v, a direction in the previous frame.
static inline float3 camera_now(__global const float *restrict camera, float3 v)
{
    return v.x * vload3(0, camera) + v.y * vload3(0, camera + 4) + v.z * vload3(0, camera + 8);
}
