// Cube maps around a point. Faces 2 a and 2 a + 1 look along the axis a and against it. Rows and columns of
// both follow the next two axes, cyclically.
#pragma once

#define CUBE_FACES 6

// Return the components of v along an axis, and along the columns and rows of its faces.
static inline float3 to_face(int axis, float3 v)
{
    return axis == 0 ? v.xyz : axis == 1 ? v.yzx : v.zxy;
}

static inline float3 from_face(int axis, float3 r)
{
    return axis == 0 ? r.xyz : axis == 1 ? r.zxy : r.yzx;
}

static inline float face_sign(int face) { return face & 1 ? -1.0f : 1.0f; }

// Return the direction, not normalized, of a place on a face. Texel centres lie at whole numbers.
static inline float3 cube_direction(int face, float2 at, int side)
{
    const float2 across = (2.0f * at + 1.0f) / side - 1.0f;
    return from_face(face >> 1, (float3)(face_sign(face), across));
}

// Return the place where a direction crosses a face. The direction must lead towards the face.
static inline float2 cube_place(int face, float3 v, int side)
{
    const float3 r = to_face(face >> 1, v);
    return 0.5f * side * (r.yz / fabs(r.x) + 1.0f) - 0.5f;
}
