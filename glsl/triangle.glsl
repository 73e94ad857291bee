// Intersection of a ray from the origin with a triangle.

// Return d . (a x b) for the edges opposite to each corner. All have one sign where the line along d passes
// through the triangle: positive if the triangle faces away from the origin. The form with the edge vector
// keeps the error at the edge's own scale.
vec3 edge_functions(vec3 d, vec3 corner0, vec3 corner1, vec3 corner2)
{
    return vec3(dot(d, cross(corner1, corner2 - corner1)),
                dot(d, cross(corner2, corner0 - corner2)),
                dot(d, cross(corner0, corner1 - corner0)));
}

// Return barycentric coordinates, clamped to the triangle: the rasterizer's grid (1/256 pixel) lets rays
// through that just miss it.
vec3 barycentric(vec3 edges)
{
    float sum = edges.x + edges.y + edges.z;
    vec3 inside = max(sum < 0.0 ? -edges : edges, 0.0);
    float total = inside.x + inside.y + inside.z;
    return total > 0.0 ? inside / total : vec3(1.0 / 3.0);
}
