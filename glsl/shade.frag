// One layer from the visible triangles: normal, radial distance, albedo and material.
//
// Everything is evaluated where the pixel-centre ray meets the triangle's plane; nothing is interpolated by
// the rasterizer. With TEXTURED, only the pixels of one textured material. With DEFORMING, also the
// deformation since the previous frame. With PRINCIPLED, also metalness and alpha. With EMISSION,
// also emitted radiance. With TEXTURE_PLACES, some maps lie elsewhere than the color's.
#version 330
#include "view.glsl"
#include "mesh.glsl"
#include "triangle.glsl"

uniform sampler2D seen_facing; // nearest triangle that faces the capture centre: 1 + number, or 0
uniform sampler2D seen_away;   // nearest triangle that faces away
uniform bool back_layer;       // the nearest that faces away, else the nearest of either
uniform sampler2D table;       // per material: albedo; three rows of its object's motion; metalness, alpha; emission
#ifdef TEXTURED
uniform sampler2D image;       // factors of the albedo
uniform bvec2 image_mirrored;  // it is mirrored beyond 0 and 1
uniform int textured;          // index of the textured material
#ifdef PRINCIPLED
uniform sampler2D finish_image; // factors of metalness and of the square root of alpha
uniform bvec2 finish_image_mirrored;
#ifdef TEXTURE_PLACES
uniform mat3x2 finish_image_place;  // map of texture coordinates to those of the image, v down
uniform bool finish_image_second;   // it applies to the second set
#endif
#endif
#ifdef EMISSION
uniform sampler2D emission_image; // factors of the emission
uniform bvec2 emission_image_mirrored;
#ifdef TEXTURE_PLACES
uniform mat3x2 emission_image_place;
uniform bool emission_image_second;
#endif
#endif
#ifdef NORMAL_MAPS
uniform sampler2D normal_image; // directions along tangent, bitangent and normal
uniform bvec2 normal_image_mirrored;
#ifdef TEXTURE_PLACES
uniform mat3x2 normal_image_place;
uniform bool normal_image_second;
#endif
const float MIN_RISE = 0.01;    // least cosine between its normals and the triangle's
#endif
#ifdef VARIANTS
uniform usampler2D variant_image; // variants of the material
uniform bvec2 variant_image_mirrored;
uniform int first_variant;      // index of the first of them; 0: it has none
#endif
#endif

layout(location = 0) out vec4 geometry;   // world normal on the side seen, radial distance
layout(location = 1) out vec4 material;   // albedo, 1 + material index
#ifdef DEFORMING
layout(location = 2) out vec4 displaced;  // world space, to the mesh's shape before deformation; 0
#endif
#ifdef PRINCIPLED
layout(location = FINISH_IMAGE) out vec4 finish;   // metalness, alpha, 0, 0
#endif
#ifdef EMISSION
layout(location = EMISSION_IMAGE) out vec4 emission;   // radiance, 0
#endif

#ifdef TEXTURED
// Return texture coordinates within 0 and 1 where they are mirrored beyond, v down.
vec2 mirror(vec2 at, bvec2 mirrored)
{
    return mix(at, 1.0 - abs(1.0 - mod(at, 2.0)), mirrored);
}

// Return the value of an image; uv: its coordinates at the corners, whose weights change by `right` and `below` from
// one pixel to the next.
vec4 filtered(sampler2D image, mat3x2 uv, bvec2 mirrored, vec3 weights, vec3 right, vec3 below)
{
    return textureGrad(image, mirror(uv * weights, mirrored), uv * right, uv * below);
}

#ifdef TEXTURE_PLACES
// Return coordinates at the corners of an image that lies elsewhere.
mat3x2 placed(mat3x2 place, bool second, mat3x2 uv, mat3x2 uv2)
{
    mat3x2 from = second ? uv2 : uv;
    return place * mat3(vec3(from[0], 1.0), vec3(from[1], 1.0), vec3(from[2], 1.0));
}
#endif
#endif

float distance_along(vec3 d, int number)
{
    ivec4 triangle = fetch_triangle(number - 1);
    vec3 a = position_u(triangle.x).xyz, b = position_u(triangle.y).xyz;
    vec3 c = position_u(triangle.z).xyz;
    return dot(barycentric(edge_functions(d, a, b, c)), vec3(dot(a, d), dot(b, d), dot(c, d)));
}

int choose(int facing, int away, vec3 d)
{
    if (facing == 0 || away == 0)
        return facing + away;
    if (back_layer || distance_along(d, away) < distance_along(d, facing))
        return away;
    return facing;
}

void main()
{
    geometry = vec4(0.0);
    material = vec4(0.0);
#ifdef DEFORMING
    displaced = vec4(0.0);
#endif
#ifdef PRINCIPLED
    finish = vec4(0.0);
#endif
#ifdef EMISSION
    emission = vec4(0.0);
#endif
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec2 at = image_point(gl_FragCoord.xy);
    vec3 d = world_from_view * view_direction(at);
    int number = choose(int(texelFetch(seen_facing, texel, 0).r),
                        int(texelFetch(seen_away, texel, 0).r), d);
    if (number == 0) {
#ifdef TEXTURED
        discard;
#endif
        return;
    }
    ivec4 triangle = fetch_triangle(number - 1);
    vec4 p0 = position_u(triangle.x), p1 = position_u(triangle.y), p2 = position_u(triangle.z);
    vec4 n0 = normal_v(triangle.x), n1 = normal_v(triangle.y), n2 = normal_v(triangle.z);

    vec3 edges = edge_functions(d, p0.xyz, p1.xyz, p2.xyz);
    vec3 weights = barycentric(edges);
    vec3 normal = weights.x * n0.xyz + weights.y * n1.xyz + weights.z * n2.xyz;
    float size = length(normal);
    vec3 up = normalize(cross(p1.xyz - p0.xyz, p2.xyz - p0.xyz));
    normal = size > 1e-6 ? normal / size : up;
    up = dot(up, normal) < 0.0 ? -up : up;
    float side = dot(up, d) > 0.0 ? -1.0 : 1.0;
    geometry = vec4(side * normal, dot(weights, vec3(dot(p0.xyz, d), dot(p1.xyz, d), dot(p2.xyz, d))));
    vec3 albedo = texelFetch(table, ivec2(0, triangle.w), 0).rgb;
#ifdef DEFORMING
    displaced = weights.x * displacement(triangle.x) + weights.y * displacement(triangle.y)
        + weights.z * displacement(triangle.z);
#endif

#ifdef PRINCIPLED
    finish.xy = texelFetch(table, ivec2(4, triangle.w), 0).xy;
#endif
#ifdef EMISSION
    emission.rgb = texelFetch(table, ivec2(5, triangle.w), 0).rgb;
#endif
#ifdef TEXTURED
    if (triangle.w != textured)
        discard;
    // v points up, rows run down.
    mat3x2 uv = mat3x2(p0.w, 1.0 - n0.w, p1.w, 1.0 - n1.w, p2.w, 1.0 - n2.w);
    vec3 right = edge_functions(world_from_view * view_direction(at + vec2(1.0, 0.0)),
                                p0.xyz, p1.xyz, p2.xyz);
    vec3 below = edge_functions(world_from_view * view_direction(at + vec2(0.0, 1.0)),
                                p0.xyz, p1.xyz, p2.xyz);
    vec3 one = vec3(1.0);
    vec3 here = edges / dot(edges, one);
    right = right / dot(right, one) - here;
    below = below / dot(below, one) - here;
    albedo *= filtered(image, uv, image_mirrored, weights, right, below).rgb;
#ifdef TEXTURE_PLACES
    vec2 c0 = second_uv(triangle.x), c1 = second_uv(triangle.y), c2 = second_uv(triangle.z);
    mat3x2 uv2 = mat3x2(c0.x, 1.0 - c0.y, c1.x, 1.0 - c1.y, c2.x, 1.0 - c2.y);
#endif
#ifdef PRINCIPLED
    mat3x2 finish_uv = uv;
#ifdef TEXTURE_PLACES
    finish_uv = placed(finish_image_place, finish_image_second, uv, uv2);
#endif
    vec2 scale = filtered(finish_image, finish_uv, finish_image_mirrored, weights, right, below).rg;
    finish.xy *= vec2(scale.x, scale.y * scale.y);
#endif
#ifdef EMISSION
    mat3x2 emission_uv = uv;
#ifdef TEXTURE_PLACES
    emission_uv = placed(emission_image_place, emission_image_second, uv, uv2);
#endif
    emission.rgb *= filtered(emission_image, emission_uv, emission_image_mirrored, weights, right, below).rgb;
#endif
#ifdef NORMAL_MAPS
    vec4 tangent = weights.x * tangent_side(triangle.x) + weights.y * tangent_side(triangle.y)
        + weights.z * tangent_side(triangle.z);
    mat3x2 normal_uv = uv;
#ifdef TEXTURE_PLACES
    normal_uv = placed(normal_image_place, normal_image_second, uv, uv2);
#endif
    vec3 bump = filtered(normal_image, normal_uv, normal_image_mirrored, weights, right, below).rgb;
    vec3 x = tangent.xyz, y = (tangent.w < 0.0 ? -1.0 : 1.0) * cross(normal, tangent.xyz);
    vec3 mapped = bump.x * x / max(length(x), 1e-9) + bump.y * y / max(length(y), 1e-9)
        + max(bump.z, 0.0) * normal;
    mapped = length(mapped) > 1e-6 ? normalize(mapped) : normal;
    geometry.xyz = side * normalize(mapped + max(MIN_RISE - dot(mapped, up), 0.0) * up);
#endif
#endif
    int index = triangle.w;
#if defined(TEXTURED) && defined(VARIANTS)
    if (first_variant > 0)
        index = first_variant + int(textureLod(variant_image, mirror(uv * weights, variant_image_mirrored), 0.0).r);
#endif
    material = vec4(albedo, float(index + 1));
}
