// Visibility, equirect: a conservative rectangle of pixels around the triangle, twice where it crosses the
// seam. Edges are great circles: they bulge towards the pole beyond their end points, and a triangle that
// contains a pole spans all columns. Rectangles without a pixel centre are dropped, which removes most
// triangles of a dense mesh.
#version 330
#include "view.glsl"

layout(triangles) in;
layout(triangle_strip, max_vertices = 8) out;

uniform vec2 target_size;    // samples
uniform float side;          // +1: only triangles that face away from the capture centre, in the
                             // winding of the buffer; -1: only the others; 0: all

in vec3 local[];
in vec2 image[];
flat in float triangle[];

flat out vec3 corner0, corner1, corner2;
flat out vec3 tolerance;     // of the edge functions
flat out float number;

const float ROUNDING = 1e-6; // bounds the rounding error of an edge function / (|a| |b - a|)
const float PAD = 0.02;      // samples; covers the rounding of image points

// Widen rows to the turning points of the great circle through a and b, with normal n.
void include_bulge(vec3 a, vec3 b, vec3 n, inout vec2 rows)
{
    float leaving = n.z * a.x - n.x * a.z;    // y of n x a: whether the arc rises at a
    float arriving = b.z * n.x - b.x * n.z;   // y of b x n: whether it falls at b
    if (leaving * arriving < 0.0 || dot(n, n) == 0.0)
        return;
    float turn = atan(abs(n.y), length(n.xz)) / PI * view_size.y;
    if (leaving >= 0.0 && arriving >= 0.0)
        rows.x = min(rows.x, turn);
    if (leaving <= 0.0 && arriving <= 0.0)
        rows.y = max(rows.y, view_size.y - turn);
}

// Emit one copy of the rectangle; bounds are samples of the target.
void emit_rectangle(vec2 low, vec2 high)
{
    if (high.x <= 0.0 || low.x >= target_size.x)
        return;
    for (int i = 0; i < 4; ++i) {
        vec2 at = vec2((i & 1) == 0 ? low.x : high.x, (i & 2) == 0 ? low.y : high.y);
        corner0 = local[0];
        corner1 = local[1];
        corner2 = local[2];
        tolerance = ROUNDING * vec3(length(corner1) * length(corner2 - corner1),
                                    length(corner2) * length(corner0 - corner2),
                                    length(corner0) * length(corner1 - corner0));
        number = triangle[0];
        gl_Position = vec4(2.0 * at / target_size - 1.0, 0.0, 1.0);
        EmitVertex();
    }
    EndPrimitive();
}

void main()
{
    vec3 a = local[0], b = local[1], c = local[2];
    float facing = dot(a, cross(b - a, c - a));   // > 0: away
    if (side != 0.0 && (facing > 0.0) != (side > 0.0))
        return;

    vec2 rows = vec2(min(min(image[0].y, image[1].y), image[2].y),
                     max(max(image[0].y, image[1].y), image[2].y));
    vec3 ab = cross(a, b - a), bc = cross(b, c - b), ca = cross(c, a - c);
    include_bulge(a, b, ab, rows);
    include_bulge(b, c, bc, rows);
    include_bulge(c, a, ca, rows);

    // Azimuths unwrap around the first. Only around a pole do they span half a turn or more.
    vec2 step = vec2(image[1].x, image[2].x) - image[0].x;
    step -= view_size.x * floor(step / view_size.x + 0.5);
    vec2 columns = image[0].x + vec2(min(min(step.x, step.y), 0.0), max(max(step.x, step.y), 0.0));
    if (columns.y - columns.x > 0.4995 * view_size.x)
        columns = vec2(0.0, view_size.x);

    // The vertical line through the origin passes through the triangle where all edge functions of +Y have
    // one sign.
    vec3 slack = ROUNDING * vec3(length(b) * length(c - b), length(c) * length(a - c),
                                 length(a) * length(b - a));
    vec3 upright = vec3(bc.y, ca.y, ab.y);
    if (all(greaterThanEqual(upright, -slack)) || all(lessThanEqual(upright, slack))) {
        if (dot(abs(upright) + slack, vec3(a.y, b.y, c.y)) >= 0.0)
            rows.x = 0.0;
        else
            rows.y = view_size.y;
    }

    // Only pixel centres inside count; in samples of the target, whose corner is on the grid.
    vec2 low = ceil((vec2(columns.x, rows.x) - window.xy) * window.z - 0.5 - PAD);
    vec2 high = floor((vec2(columns.y, rows.y) - window.xy) * window.z - 0.5 + PAD) + 1.0;
    if (high.x <= low.x || high.y <= low.y || high.y <= 0.0 || low.y >= target_size.y)
        return;
    emit_rectangle(low, high);
    float turn = view_size.x * window.z;
    if (columns.x < 0.5)
        emit_rectangle(vec2(low.x + turn, low.y), vec2(high.x + turn, high.y));
    if (columns.y > view_size.x - 0.5)
        emit_rectangle(vec2(low.x - turn, low.y), vec2(high.x - turn, high.y));
}
