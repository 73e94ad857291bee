// Visibility, perspective: transforms world-space vertices to the target's window of the view. Clip-space z
// is 0 (the fragment shader writes depth), so that nothing is clipped by near or far planes; w >= 0 alone
// clips points behind the camera.
#version 330
#include "view.glsl"

uniform vec2 target_size;    // samples

in vec3 position;            // world space, three per triangle
flat out float number;       // 1 + triangle number

void main()
{
    vec3 local = position * world_from_view;
    float w = -local.z;
    vec2 image_w = 0.5 * view_size * w + focal_px * vec2(local.x, -local.y);
    number = float(gl_VertexID / 3 + 1);
    vec2 target_w = (image_w - window.xy * w) * window.z;
    gl_Position = vec4(2.0 * target_w / target_size - w, 0.0, w);
}
