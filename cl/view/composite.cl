// Differential rendering (IPRT Eq. 2, with the radiance of glossy objects added):
//   L = (1 - M) (k_V E_diffuse + L_specular) + M L_cam E_RV / E_R,  M = 1 - coverage.
//
// With -DGLOSS the real layer is L_cam + L_diffuse (E_RV / E_R - 1) + change: only what surfaces
// radiate to all sides follows the irradiance, and what they reflect towards the camera changes apart.
//
// With -DCOLOR_MAP objects and what they change are in the colours of a reference frame, which a map
// takes to those of the frame: L_cam + map(L_diffuse (E_RV / E_R - 1) + change).
//
//   in   colour (3 planes, radiance of the real layer),
//        -DHAS_RATIO: ratio (float4 per pixel, no border); other (1 plane, share of a second surface in
//        the radiance) and other_pixel (a pixel that shows it) of sharpen.cl,
//        -DHAS_BASE: base (3 planes, L_diffuse), with a ratio and gloss or a map,
//        -DGLOSS: change (3 planes, radiance of either sign),
//        -DCOLOR_MAP: maps (lib/world/real/color_map.h),
//        -DHAS_OBJECTS: coverage (1 plane, [0, 1]),
//        -DHAS_DIFFUSE: albedo (3 planes), diffuse (3 planes: what albedo is multiplied by),
//        -DHAS_SPECULAR: specular (3 planes, radiance)
//   out  picture (height x width x 4, row 0 the top): linear rgb, a = coverage
//
// Where coverage is 0, the ratio 1 and the change 0, the output has the bits of the input.
#include "gbuffer/planes.h"
#ifdef COLOR_MAP
#include "world/real/color_map.h"
#endif

__kernel void composite(
    __global const float *restrict colour,   // 3 planes
#ifdef HAS_RATIO
    __global const float4 *restrict ratio,   // float4 per pixel
    __global const float *restrict other,    // 1 plane
    __global const int *restrict other_pixel,
#endif
#ifdef HAS_BASE
    __global const float *restrict base,     // 3 planes
#endif
#ifdef GLOSS
    __global const float *restrict change,   // 3 planes
#endif
#ifdef COLOR_MAP
    __global const float4 *restrict maps,
#endif
#ifdef HAS_OBJECTS
    __global const float *restrict coverage, // 1 plane
#endif
#ifdef HAS_DIFFUSE
    __global const float *restrict albedo,   // 3 planes
    __global const float *restrict diffuse,  // 3 planes
#endif
#ifdef HAS_SPECULAR
    __global const float *restrict specular, // 3 planes
#endif
    __global float4 *restrict picture,       // out: rgba per pixel
    int width,
    int height)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int size = plane_size(width, height), p = plane_index(x, y, width), i = y * width + x;
    float4 background = (float4)(colour[p], colour[size + p], colour[2 * size + p], 0.0f);
#ifdef HAS_RATIO
    float4 relit = ratio[i];
    const float share = other[p];
    if (share > 0.0f)
        relit += share * (ratio[other_pixel[i]] - relit);
#endif
#if defined(HAS_BASE)
    float3 changed = load_planes(base, size, p) * (relit.xyz - 1.0f);
#ifdef GLOSS
    changed += load_planes(change, size, p);
#endif
#ifdef COLOR_MAP
    changed = map_color(maps, TO_FRAME, changed);
#endif
    background.xyz = fmax(background.xyz + changed, 0.0f);
#elif defined(HAS_RATIO)
    background *= relit;
#endif
#ifdef HAS_OBJECTS
    float4 object = (float4)(0.0f);
#ifdef HAS_DIFFUSE
    object.x = albedo[p] * diffuse[p];
    object.y = albedo[size + p] * diffuse[size + p];
    object.z = albedo[2 * size + p] * diffuse[2 * size + p];
#endif
#ifdef HAS_SPECULAR
    object += (float4)(specular[p], specular[size + p], specular[2 * size + p], 0.0f);
#endif
#ifdef COLOR_MAP
    object.xyz = fmax(map_color(maps, TO_FRAME, object.xyz), 0.0f);
#endif
    object.w = 1.0f;
    float a = coverage[p];
    // A choice, not a product with 0: pixels without an object keep their bits whatever lies there.
    picture[i] = a > 0.0f ? a * object + (1.0f - a) * background : background;
#else
    picture[i] = background;
#endif
}
