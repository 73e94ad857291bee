// Directions of the panorama's texels, and tangent planes.
#pragma once

// Planes seen at a smaller cosine are tilted towards the viewer, so that g stays bounded.
#define GRAZING 0.02f
// Shorter vectors are not normals.
#define LEAST_NORMAL 0.1f
// Floats before images and tables of columns, so that reads to the left of the first texel are valid.
#define MARGIN 16

// Return the unit direction of a texel's centre from tables: sines would dominate the kernel's time.
static inline float3 centre_direction(float2 azimuth, float2 polar)
{
    return (float3)(polar.y * azimuth.y, polar.x, -polar.y * azimuth.x);
}

// Return g of the plane with unit normal n, towards the centre, through the point at distance 1 along v.
static inline float3 tangent_plane(float3 n, float3 v)
{
    float facing = dot(n, v);
    if (!(facing < -GRAZING)) {
        n -= (facing + GRAZING) * v;
        facing = -GRAZING;
    }
    return n / facing;
}
