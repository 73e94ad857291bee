// Rays against the triangles of a packet of bvh.h, which includes this.
#pragma once

// Find the nearest hit among the four triangles of a packet, if nearer than hit->t. The edge functions of
// adjacent triangles must be each other's negative, bit for bit, and NaN where all vanish: in degenerate
// triangles and those seen edge-on.
#ifdef BVH_WIDE

static inline float bvh_column(float4 v, int column)
{
    const float2 half_of = column & 2 ? v.zw : v.xy;
    return column & 1 ? half_of.y : half_of.x;
}

static inline int bvh_packet(const Bvh bvh, const BvhRay ray, int packet, BvhHit *hit)
{
// The edge functions of adjacent triangles must be each other's negative, bit for bit.
#pragma OPENCL FP_CONTRACT OFF
    __global const float4 *a = bvh.packets + BVH_PACKET_ROWS * packet, *b = a + 3, *c = a + 6;
    const float3 o = ray.o;
    const float4 az = a[ray.kz] - o.z, bz = b[ray.kz] - o.z, cz = c[ray.kz] - o.z;
    const float4 ax = (a[ray.kx] - o.x) - ray.sheared.x * az;
    const float4 bx = (b[ray.kx] - o.x) - ray.sheared.x * bz;
    const float4 cx = (c[ray.kx] - o.x) - ray.sheared.x * cz;
    const float4 ay = (a[ray.ky] - o.y) - ray.sheared.y * az;
    const float4 by = (b[ray.ky] - o.y) - ray.sheared.y * bz;
    const float4 cy = (c[ray.ky] - o.y) - ray.sheared.y * cz;
    const float4 u = cx * by - cy * bx, v = ax * cy - ay * cx, w = bx * ay - by * ax;
    const int4 inside = ((u >= 0.0f) & (v >= 0.0f) & (w >= 0.0f))
        | ((u <= 0.0f) & (v <= 0.0f) & (w <= 0.0f));
    if (!(inside.x | inside.y | inside.z | inside.w))
        return 0;
    // NaN where all edge functions vanish: degenerate triangles and triangles seen edge-on.
    const float4 sum = u + v + w;
    const float4 t = (u * az + v * bz + w * cz) * ray.sheared.z / sum;
    const int4 nearer = inside & (t > 0.0f) & (t < hit->t);
    const int4 bits = nearer ? as_int4(t) : (int4)(BVH_NO_CHILD);
    const int nearest = min(min(bits.x, bits.y), min(bits.z, bits.w));
    if (nearest == BVH_NO_CHILD)
        return 0;
    const int column = nearest == bits.x ? 0 : nearest == bits.y ? 1 : nearest == bits.z ? 2 : 3;
    const float4 inverse = 1.0f / sum;
    hit->t = as_float(nearest);
    hit->triangle = 4 * packet + column;
    hit->u = bvh_column(v * inverse, column);
    hit->v = bvh_column(w * inverse, column);
    return 1;
}

#else

static inline int bvh_packet(const Bvh bvh, const BvhRay ray, int packet, BvhHit *hit)
{
#pragma OPENCL FP_CONTRACT OFF
    __global const float *corners = (__global const float *)(bvh.packets + BVH_PACKET_ROWS * packet);
    const int kx = bvh_next_axis(ray.kz), ky = bvh_next_axis(kx);
    __global const float *x = corners + 4 * kx, *y = corners + 4 * ky, *z = corners + 4 * ray.kz;
    const float3 o = bvh_permuted(ray.o, ray.kz);
    int met = 0;
#pragma unroll 1
    for (int column = 0; column < 4; column++) {
        const float az = z[column] - o.z, bz = z[column + 12] - o.z, cz = z[column + 24] - o.z;
        const float ax = (x[column] - o.x) - ray.sheared.x * az;
        const float bx = (x[column + 12] - o.x) - ray.sheared.x * bz;
        const float cx = (x[column + 24] - o.x) - ray.sheared.x * cz;
        const float ay = (y[column] - o.y) - ray.sheared.y * az;
        const float by = (y[column + 12] - o.y) - ray.sheared.y * bz;
        const float cy = (y[column + 24] - o.y) - ray.sheared.y * cz;
        const float u = cx * by - cy * bx, v = ax * cy - ay * cx, w = bx * ay - by * ax;
        if (!((u >= 0.0f && v >= 0.0f && w >= 0.0f) || (u <= 0.0f && v <= 0.0f && w <= 0.0f)))
            continue;
        const float sum = u + v + w, t = (u * az + v * bz + w * cz) * ray.sheared.z / sum;
        if (!(t > 0.0f && t < hit->t))
            continue;
        const float inverse = 1.0f / sum;
        hit->t = t;
        hit->triangle = 4 * packet + column;
        hit->u = v * inverse;
        hit->v = w * inverse;
        met = 1;
    }
    return met;
}

#endif
