// The displayed layer from the front layer: coverage, borrowed edges, motion.
//
// Coverage is the fraction of SAMPLES x SAMPLES sub-samples whose nearest object is in front of the real
// surface: r <= r_real (1 + tolerance), where r_real = 1 / (g . d) is the tangent plane g of the panorama's
// texel (g . d <= 0: no surface). It is 1 - M of IPRT Eq. 2. A covered pixel whose centre has no surface
// borrows a neighbour's normal, material and tangent plane, whose distance is along this pixel's ray, also
// behind real surfaces. Motion is the image point, in the previous view, of the surface point before its
// object moved; with DEFORMING, also before its mesh deformed.
#version 330
#include "view.glsl"
#include "depth.glsl"

uniform sampler2D geometry_in;       // front layer
uniform sampler2D material_in;
#ifdef DEFORMING
uniform sampler2D displaced_in;
#endif
#ifdef PRINCIPLED
uniform sampler2D finish_in;
#endif
#ifdef EMISSION
uniform sampler2D emission_in;
#endif
uniform sampler2D samples;           // encoded depth, SAMPLES x SAMPLES texels per pixel
uniform ivec2 samples_origin;        // pixel of its corner
uniform sampler2D surface;           // tangent planes of the real scene, equirect
uniform sampler2D table;             // as in shade.frag
uniform float tolerance;             // of the comparison of distances, relative

uniform mat3 previous_world_from_view;
uniform float previous_focal_px;
uniform vec2 previous_view_size;

layout(location = 0) out vec4 geometry;
layout(location = 1) out vec4 material;
layout(location = 2) out vec4 display;   // coverage, previous image point, fraction with any object
#ifdef PRINCIPLED
layout(location = 3) out vec4 finish;    // metalness, alpha, 0, 0
#endif
#ifdef EMISSION
layout(location = 4) out vec4 emission;  // radiance, 0
#endif

const float NOWHERE = -1e9;
const float BORROW_RANGE = 0.03;         // largest relative change of distance by borrowing

const ivec2 NEIGHBOURS[8] = ivec2[8](ivec2(-1, 0), ivec2(1, 0), ivec2(0, -1), ivec2(0, 1),
                                     ivec2(-1, -1), ivec2(1, -1), ivec2(-1, 1), ivec2(1, 1));

vec3 tangent_plane(vec3 d)
{
    vec2 uv = vec2(atan(d.x, -d.z) / (2.0 * PI) + 0.5, atan(length(d.xz), d.y) / PI);
    ivec2 size = textureSize(surface, 0);
    return texelFetch(surface, min(ivec2(uv * vec2(size)), size - 1), 0).xyz;
}

// Return the fractions of a pixel in which an object is in front of the real surface, and in which there is
// any object.
vec2 visible_fraction(ivec2 pixel)
{
    ivec2 corner = (pixel - samples_origin) * SAMPLES;
    vec2 visible = vec2(0.0);
    for (int y = 0; y < SAMPLES; ++y) {
        for (int x = 0; x < SAMPLES; ++x) {
            float z = texelFetch(samples, corner + ivec2(x, y), 0).r;
            if (z == 0.0)
                continue;
            vec2 inside = (vec2(x, y) + 0.5) / float(SAMPLES);
            vec3 d = world_from_view * view_direction(vec2(pixel) + inside);
            if (decode_depth(z) * dot(tangent_plane(d), d) <= 1.0 + tolerance)
                visible.x += 1.0;
            visible.y += 1.0;
        }
    }
    return visible / float(SAMPLES * SAMPLES);
}

// Return the pixel to borrow a surface from; the pixel itself if there is none.
ivec2 borrow(ivec2 pixel, vec3 d)
{
    ivec2 size = ivec2(view_size);
    for (int i = 0; i < 8; ++i) {
        ivec2 from = pixel + NEIGHBOURS[i];
#ifdef EQUIRECT
        from.x = (from.x + size.x) % size.x;
#endif
        if (any(lessThan(from, ivec2(0))) || any(greaterThanEqual(from, size)))
            continue;
        vec4 lent = texelFetch(geometry_in, from, 0);
        if (lent.w == 0.0)
            continue;
        vec3 covered = world_from_view * view_direction(vec2(from) + 0.5);
        float ratio = dot(lent.xyz, covered) / dot(lent.xyz, d);
        // A plane seen edge-on has no ratio, or one of any size.
        ratio = ratio > 0.0 ? clamp(ratio, 1.0 - BORROW_RANGE, 1.0 + BORROW_RANGE) : 1.0;
        geometry = vec4(lent.xyz, lent.w * ratio);
        material = texelFetch(material_in, from, 0);
        return from;
    }
    return pixel;
}

vec2 previous_image_point(vec3 point, int index)
{
    vec4 p = vec4(point, 1.0);
    vec3 before = vec3(dot(texelFetch(table, ivec2(1, index), 0), p),
                       dot(texelFetch(table, ivec2(2, index), 0), p),
                       dot(texelFetch(table, ivec2(3, index), 0), p));
    vec3 local = before * previous_world_from_view;
#ifdef EQUIRECT
    float u = atan(local.x, -local.z) / (2.0 * PI) + 0.5;
    return vec2(u - floor(u), atan(length(local.xz), local.y) / PI) * previous_view_size;
#else
    if (local.z >= 0.0)
        return vec2(NOWHERE);
    return 0.5 * previous_view_size + previous_focal_px * vec2(local.x, -local.y) / -local.z;
#endif
}

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec3 d = world_from_view * view_direction(gl_FragCoord.xy);
    geometry = texelFetch(geometry_in, pixel, 0);
    material = texelFetch(material_in, pixel, 0);
    vec2 coverage = visible_fraction(pixel);
    ivec2 covered = pixel;
    if (geometry.w == 0.0 && coverage.y > 0.0)
        covered = borrow(pixel, d);
#ifdef PRINCIPLED
    finish = texelFetch(finish_in, covered, 0);
#endif
#ifdef EMISSION
    emission = texelFetch(emission_in, covered, 0);
#endif
    if (geometry.w == 0.0) {
        display = vec4(0.0, NOWHERE, NOWHERE, 0.0);
        return;
    }
    vec3 point = geometry.w * d;
#ifdef DEFORMING
    point += texelFetch(displaced_in, covered, 0).xyz;
#endif
    display = vec4(coverage.x, previous_image_point(point, int(material.w) - 1), coverage.y);
}
