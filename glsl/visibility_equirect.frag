// Visibility, equirect: exact test of the pixel-centre ray against the triangle. Outputs 1 + the number of
// the visible triangle; depth is the radial distance. Edges are inclusive within the rounding error, so
// that no ray slips between neighbours.
#version 330
#include "view.glsl"
#include "triangle.glsl"
#include "depth.glsl"

flat in vec3 corner0, corner1, corner2;
flat in vec3 tolerance;
flat in float number;

#ifndef DEPTH_ONLY
layout(location = 0) out float seen;
#endif

void main()
{
    vec3 d = view_direction(image_point(gl_FragCoord.xy));
    vec3 edges = edge_functions(d, corner0, corner1, corner2);
    float sum = edges.x + edges.y + edges.z;
    vec3 inside = sum < 0.0 ? -edges : edges;
    vec3 along = vec3(dot(corner0, d), dot(corner1, d), dot(corner2, d));
    float r = dot(barycentric(edges), along);
    if (any(lessThan(inside, -tolerance)) || sum == 0.0 || !(r > 0.0))
        discard;
    gl_FragDepth = encode_depth(r);
#ifndef DEPTH_ONLY
    seen = number;
#endif
}
