// Visibility, equirect: view-space position of each vertex and its equirect image point.
#version 330
#include "view.glsl"

in vec3 position;            // world space, three per triangle
out vec3 local;
out vec2 image;
flat out float triangle;     // 1 + triangle number

void main()
{
    local = position * world_from_view;
    triangle = float(gl_VertexID / 3 + 1);
    // Any azimuth is valid on the vertical axis: the triangle then spans all columns.
    float phi = all(equal(local.xz, vec2(0.0))) ? 0.0 : atan(local.x, -local.z);
    float theta = all(equal(local, vec3(0.0))) ? 0.0 : atan(length(local.xz), local.y);
    image = vec2(phi / (2.0 * PI) + 0.5, theta / PI) * view_size;
}
