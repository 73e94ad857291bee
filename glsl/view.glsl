// The rendered view, and the window of it that the bound target shows. EQUIRECT selects the equirect
// projection, else perspective. An image point is in pixels with y down. The target's rows run the same
// way, so texel (x, y) of a full-size target is the pixel in column x, row y.

const float PI = 3.14159265358979;

uniform mat3 world_from_view;
uniform float focal_px;      // perspective only
uniform vec2 view_size;      // pixels
uniform vec3 window;         // image point of the target's corner; samples per pixel

// Return the image point of a target point, in samples.
vec2 image_point(vec2 target_point)
{
    return window.xy + target_point / window.z;
}

// Return the view-space unit direction through an image point.
vec3 view_direction(vec2 image)
{
#ifdef EQUIRECT
    float phi = (image.x / view_size.x - 0.5) * (2.0 * PI);
    float theta = image.y / view_size.y * PI;
    return vec3(sin(theta) * sin(phi), cos(theta), -sin(theta) * cos(phi));
#else
    vec2 offset = image - 0.5 * view_size;
    return normalize(vec3(offset.x, -offset.y, -focal_px));
#endif
}
