// The triangles of all instances, in world space, as textures.

uniform isampler2D triangles;   // three vertex numbers, material index
uniform sampler2D vertices;     // two texels per vertex: (position, u), (normal, v)

// Widths of the two textures in texels, as powers of two.
const int TRIANGLES_WIDTH_LOG2 = 11;
const int VERTICES_WIDTH_LOG2 = 11;

ivec4 fetch_triangle(int index)
{
    int column = index & ((1 << TRIANGLES_WIDTH_LOG2) - 1);
    return texelFetch(triangles, ivec2(column, index >> TRIANGLES_WIDTH_LOG2), 0);
}

vec4 fetch_vertex(int texel)
{
    int column = texel & ((1 << VERTICES_WIDTH_LOG2) - 1);
    return texelFetch(vertices, ivec2(column, texel >> VERTICES_WIDTH_LOG2), 0);
}

vec4 position_u(int vertex) { return fetch_vertex(2 * vertex); }
vec4 normal_v(int vertex) { return fetch_vertex(2 * vertex + 1); }

#ifdef NORMAL_MAPS
uniform sampler2D tangents; // one texel per vertex: world space, sign of the bitangent

vec4 tangent_side(int vertex)
{
    int column = vertex & ((1 << (VERTICES_WIDTH_LOG2 - 1)) - 1);
    return texelFetch(tangents, ivec2(column, vertex >> (VERTICES_WIDTH_LOG2 - 1)), 0);
}
#endif

#ifdef TEXTURE_PLACES
uniform sampler2D uvs2; // one texel per vertex: the second set of texture coordinates

vec2 second_uv(int vertex)
{
    int column = vertex & ((1 << (VERTICES_WIDTH_LOG2 - 1)) - 1);
    return texelFetch(uvs2, ivec2(column, vertex >> (VERTICES_WIDTH_LOG2 - 1)), 0).xy;
}
#endif

#ifdef DEFORMING
uniform sampler2D displacements; // one texel per vertex: to its previous position, world space, 0

vec4 displacement(int vertex)
{
    int column = vertex & ((1 << (VERTICES_WIDTH_LOG2 - 1)) - 1);
    return texelFetch(displacements, ivec2(column, vertex >> (VERTICES_WIDTH_LOG2 - 1)), 0);
}
#endif
