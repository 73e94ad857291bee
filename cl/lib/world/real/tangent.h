// Directions of the panorama's texels, and tangent planes.
#ifndef IPRT_TANGENT_H
#define IPRT_TANGENT_H

// Planes seen at less than this cosine are tilted towards the viewer, so that g stays bounded.
#define GRAZING 0.02f
// Shorter vectors are no normals.
#define LEAST_NORMAL 0.1f
// Floats before images and tables of columns, so that what is left of the first texel can be read.
#define MARGIN 16

// Unit direction of the centre of a texel, from tables: sines would take most of the kernel's time.
static inline float3 centre_direction(float2 azimuth, float2 polar)
{
    return (float3)(polar.y * azimuth.y, polar.x, -polar.y * azimuth.x);
}

// g of a plane with unit normal n, towards the centre, through the point at distance 1 along v.
static inline float3 tangent_plane(float3 n, float3 v)
{
    float facing = dot(n, v);
    if (!(facing < -GRAZING)) {
        n -= (facing + GRAZING) * v;
        facing = -GRAZING;
    }
    return n / facing;
}

#endif
