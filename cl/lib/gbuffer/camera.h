// Motion of the 360° camera, -D CAMERA_MOTION: `camera` holds the rows of the affine map from the
// axes of this frame's capture centre to those of the frame before (3 x 4 floats).
#ifndef IPRT_CAMERA_H
#define IPRT_CAMERA_H

// The last parameter of kernels and functions that follow it.
#ifdef CAMERA_MOTION
#define CAMERA_PARAMETER , __global const float *restrict camera
#define CAMERA_ARGUMENT , camera
#else
#define CAMERA_PARAMETER
#define CAMERA_ARGUMENT
#endif

// Where the point v / w was in the frame before, times w; with w = 0 the direction v, which is
// infinitely far.
static inline float3 camera_before(__global const float *restrict camera, float3 v, float w)
{
    return (float3)(camera[0] * v.x + camera[1] * v.y + camera[2] * v.z + camera[3] * w,
                    camera[4] * v.x + camera[5] * v.y + camera[6] * v.z + camera[7] * w,
                    camera[8] * v.x + camera[9] * v.y + camera[10] * v.z + camera[11] * w);
}

// The direction now that was v in the frame before.
static inline float3 camera_now(__global const float *restrict camera, float3 v)
{
    return v.x * vload3(0, camera) + v.y * vload3(0, camera + 4) + v.z * vload3(0, camera + 8);
}

#endif
