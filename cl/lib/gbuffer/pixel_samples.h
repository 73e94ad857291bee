// Rays through samples of a pixel, as lanes: which of them meet the triangles that rays nearby meet.
#pragma once

#include "gbuffer/view.h"
#include "maths/lanes.h"
#include "world/objects/objects_bvh.h"

#define STEPS_AROUND {-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-1, -1}, {1, -1}, {-1, 1}, {1, 1}

// Return 1 / distance of the real surface along d. For lane loops.
static inline ALWAYS_INLINE float real_nearness(
    __global const float4 *restrict surface, int surface_width, int surface_height, float3 d)
{
    __global const float *restrict plane = (__global const float *)surface
        + 4 * equirect_texel(equirect_uv(d), surface_width, surface_height);
    return plane[0] * d.x + plane[1] * d.y + plane[2] * d.z;
}

// Samples of a pixel, LANES of them.
typedef struct {
    float x[LANES], y[LANES], z[LANES]; // world directions of their rays
    float nearness[LANES];              // of the real surface
    int state[LANES];
} Samples;

// States of samples.
#define KNOWN 0
#define UNKNOWN 1
#define BEHIND 2 // meets an object behind the real surface; maybe another one in front

// Return the samples from number `first` on.
static inline ALWAYS_INLINE Samples aim_samples(
    __global const float *restrict view, int x, int y, int samples, int first,
    __global const float4 *restrict surface, int surface_width, int surface_height)
{
    Samples rays;
    LANE_LOOP
    for (int i = 0; i < LANES; i++) {
        const int number = first + i, row = number / samples, column = number - row * samples;
        const float right = (column + 0.5f) / samples, down = (row + 0.5f) / samples;
        const float3 d = direction_unbranched(view, (float2)(x + right, y + down));
        rays.x[i] = d.x;
        rays.y[i] = d.y;
        rays.z[i] = d.z;
        rays.nearness[i] = real_nearness(surface, surface_width, surface_height, d);
        rays.state[i] = number < samples * samples ? UNKNOWN : KNOWN;
    }
    return rays;
}

// Find the samples that meet a triangle of a packet, by bvh_packet()'s test. Returns how many become known to
// meet one in front of the real surface, and any. `ahead`: direction of the pixel.
static inline ALWAYS_INLINE int2 meet_packet(
    const Objects world, int instance, int packet, float3 ahead, Samples *rays)
{
#pragma OPENCL FP_CONTRACT OFF
    COUNT_STEPS(world.bvh.work, WORK_OBJECTS, 1);
    __global const float4 *rows = world.bvh.instances + BVH_INSTANCE_ROWS * instance;
    __global const float *corners
        = (__global const float *)(world.bvh.packets + BVH_PACKET_ROWS * packet);
    const float3 start = bvh_transform(rows, (float3)(0.0f), 1.0f);
    const int kz = bvh_ray(start, bvh_transform(rows, ahead, 0.0f)).kz;
    const int kx = bvh_next_axis(kz), ky = bvh_next_axis(kx);
    const float3 o = bvh_permuted(start, kz);
    // Scalars, for the loop.
    const float4 row_x = rows[kx], row_y = rows[ky], row_z = rows[kz];
    const float xx = row_x.x, xy = row_x.y, xz = row_x.z;
    const float yx = row_y.x, yy = row_y.y, yz = row_y.z;
    const float zx = row_z.x, zy = row_z.y, zz = row_z.z;
    const float ox = o.x, oy = o.y, oz = o.z;
    __global const float *cx = corners + 4 * kx, *cy = corners + 4 * ky, *cz = corners + 4 * kz;
    int visible = 0, any = 0;
    LANE_LOOP
    for (int i = 0; i < LANES; i++) {
        const float x = rays->x[i], y = rays->y[i], z = rays->z[i];
        const float inverse = 1.0f / (zx * x + zy * y + zz * z);
        const float shear_x = (xx * x + xy * y + xz * z) * inverse;
        const float shear_y = (yx * x + yy * y + yz * z) * inverse;
        int met = 0, front = 0;
        #pragma unroll
        for (int column = 0; column < 4; column++) {
            const float az = cz[column] - oz, bz = cz[column + 12] - oz;
            const float dz = cz[column + 24] - oz;
            const float ax = (cx[column] - ox) - shear_x * az;
            const float bx = (cx[column + 12] - ox) - shear_x * bz;
            const float dx = (cx[column + 24] - ox) - shear_x * dz;
            const float ay = (cy[column] - oy) - shear_y * az;
            const float by = (cy[column + 12] - oy) - shear_y * bz;
            const float dy = (cy[column + 24] - oy) - shear_y * dz;
            const float u = dx * by - dy * bx, v = ax * dy - ay * dx, w = bx * ay - by * ax;
            const int inside = ((u >= 0.0f) & (v >= 0.0f) & (w >= 0.0f))
                | ((u <= 0.0f) & (v <= 0.0f) & (w <= 0.0f));
            const float t = (u * az + v * bz + w * dz) * inverse / (u + v + w);
            met |= inside & (t > 0.0f);
            front |= inside & (t > 0.0f) & (t * rays->nearness[i] <= 1.0f + COVERAGE_TOLERANCE);
        }
        const int state = rays->state[i];
        rays->state[i] = (state == KNOWN) | front ? KNOWN : met ? BEHIND : state;
        visible += front & (state != KNOWN);
        any += met & (state == UNKNOWN);
    }
    return (int2)(visible, any);
}

// Find the samples of a pixel that meet packets which its centre and the adjacent pixels' meet.
static inline ALWAYS_INLINE int2 meet_nearby(const Objects world, __global const int2 *restrict met,
                                             int4 rectangle, int x, int y, int width, float3 ahead,
                                             Samples *rays)
{
    const int2 steps[9] = {STEPS_AROUND, {0, 0}};
    int2 count = (int2)(0);
    int last = -1;
    for (int i = 0; i < 9 && count.x < LANES; i++) {
        const int column = x + steps[8 - i].x, row = y + steps[8 - i].y;
        if (column < rectangle.x || row < rectangle.y || column >= rectangle.z || row >= rectangle.w)
            continue;
        const int2 there = met[row * width + column];
        const int packet = there.y >> 2;
        if (there.x == -1 || packet == last)
            continue;
        count += meet_packet(world, there.x < 0 ? -2 - there.x : there.x, packet, ahead, rays);
        last = packet;
    }
    return count;
}
