// Differential rendering (IPRT Eq. 2, with the radiance of glossy objects added):
//   L = (1 - M) (k_V E_diffuse + L_specular) + M L_cam E_RV / E_R,  M = 1 - coverage.
//
// With gloss the real layer is L_cam + L_diffuse (E_RV / E_R - 1) + change: only diffuse radiance scales
// with the irradiance, and specular radiance towards the camera changes separately, by -(L_cam - L_diffuse)
// at the least.
//
// With a color map, objects and their changes are in the colors of a reference frame, which the map
// converts to the frame's: L_cam + map(L_diffuse (E_RV / E_R - 1) + change).
//
// A pixel that blends texels of several planes is scaled by the ratio of each, weighted by its share.
// Where a pixel shows two real surfaces, each has its own ratio, and objects may hide only one of them:
// L = (1 - M) L_object + the sum over both surfaces of (1 - hidden share) times their part of L_cam.
//
//   in   color (3 planes, radiance of the real layer),
//        other (float4 per pixel, share of a second surface in the radiance), other_pixel (a pixel
//        that shows it; -1 or the pixel itself: none) and corner of real_layer.cl
//        and each of the following that is present, else 0
//        ratio (float4 per pixel, no border),
//        base (3 planes, L_diffuse), with a ratio and gloss or a map,
//        change (3 planes, radiance of either sign), with gloss,
//        maps (lib/world/real/color_map.h),
//        coverage (1 plane, [0, 1]) and sides (float2 per pixel) of unpack.cl, with objects,
//        albedo (3 planes), diffuse (3 planes: to multiply by the albedo),
//        specular and emission (3 planes each, radiance)
//   out  picture (height x width x 4, row 0 the top): linear rgb, a = coverage
//
// Where coverage is 0, the ratio 1 and the change 0, the output has the bits of the input.
#include "gbuffer/planes.h"
#include "world/real/color_map.h"
#include "world/real/uneven.h"

typedef struct {
    __global const float *restrict color;
    __global const float *restrict base;
    __global const float *restrict change;
    __global const float4 *restrict maps;
    int width;
    int size;
} Highlights;

static inline float3 seen_at(const Highlights lights, int p)
{
    const float3 seen = load_planes(lights.color, lights.size, p);
    return lights.maps ? map_color(lights.maps, TO_REFERENCE, seen) : seen;
}

// Return the change of a pixel's highlight. Objects hide no more of it than there is.
static inline float3 change_at(const Highlights lights, int p, float3 seen)
{
    const float3 least = fmin(load_planes(lights.base, lights.size, p) - seen, 0.0f);
    return fmax(load_planes(lights.change, lights.size, p), least);
}

// The same relative to the pixel's radiance.
static inline float3 relative_change(const Highlights lights, int pixel)
{
    const int p = plane_index(pixel % lights.width, pixel / lights.width, lights.width);
    const float3 seen = seen_at(lights, p);
    return change_at(lights, p, seen) / fmax(seen, FLT_MIN);
}

// Return the change that a pixel shows, of each of its surfaces by its share in the radiance.
static inline float3 shown_change(
    const Highlights lights, int pixel, int second, float4 share, __global const int4 *restrict corner)
{
    const int p = plane_index(pixel % lights.width, pixel / lights.width, lights.width);
    const float3 seen = seen_at(lights, p);
    if (second != UNEVEN && (second < 0 || second == pixel))
        return change_at(lights, p, seen);
    const float3 own = relative_change(lights, pixel);
    float3 others;
    if (second == UNEVEN) {
        const int4 at = corner[pixel];
        others = share.x * (relative_change(lights, at.x) - own) + share.y * (relative_change(lights, at.y) - own)
            + share.z * (relative_change(lights, at.z) - own) + share.w * (relative_change(lights, at.w) - own);
    } else {
        others = share.xyz * (relative_change(lights, second) - own);
    }
    return seen * (own + others);
}

__kernel void composite(
    __global const float *restrict color,   // 3 planes
    __global const float4 *restrict other,   // float4 per pixel
    __global const int *restrict other_pixel,
    __global const int4 *restrict corner,
    __global const float4 *restrict ratio,   // float4 per pixel
    __global const float *restrict base,     // 3 planes
    __global const float *restrict change,   // 3 planes
    __global const float4 *restrict maps,
    __global const float *restrict coverage, // 1 plane
    __global const float2 *restrict sides,   // float2 per pixel
    __global const float *restrict albedo,   // 3 planes
    __global const float *restrict metallic, // 1 plane
    __global const float *restrict diffuse,  // 3 planes
    __global const float *restrict specular, // 3 planes
    __global const float *restrict emission, // 3 planes
    __global float4 *restrict picture,       // out: rgba per pixel
    int width,
    int height)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int size = plane_size(width, height), p = plane_index(x, y, width), i = y * width + x;
    float4 background = (float4)(color[p], color[size + p], color[2 * size + p], 0.0f);
    const float a = coverage ? coverage[p] : 0.0f;
    float3 left = (float3)(1.0f - a); // weight of the real layer's radiance
    const int second = other_pixel[i];
    const int is_edge = second >= 0 && second != i;
    float3 of_second = is_edge ? other[i].xyz : (float3)(0.0f);
    if (is_edge && a > 0.0f) {
        const float2 hidden = sides[i];
        of_second *= 1.0f - hidden.y;
        left = (1.0f - other[i].xyz) * (1.0f - hidden.x) + of_second;
        of_second /= fmax(left, FLT_MIN);
    }
    float4 relit = (float4)(1.0f);
    if (ratio) {
        relit = ratio[i];
        if (is_edge)
            relit.xyz += of_second * (ratio[second].xyz - relit.xyz);
        if (second == UNEVEN) {
            const float4 own = relit, share = other[i];
            const int4 at = corner[i];
            relit += share.x * (ratio[at.x] - own) + share.y * (ratio[at.y] - own)
                + share.z * (ratio[at.z] - own) + share.w * (ratio[at.w] - own);
        }
    }
    if (base) {
        float3 changed = load_planes(base, size, p) * (relit.xyz - 1.0f);
        if (change) {
            const Highlights lights = {color, base, change, maps, width, size};
            changed += shown_change(lights, i, second, other[i], corner);
        }
        if (maps)
            changed = map_color(maps, TO_FRAME, changed);
        background.xyz = fmax(background.xyz + changed, 0.0f);
    } else {
        background *= relit;
    }
    if (a > 0.0f) {
        float4 object = (float4)(0.0f);
        if (diffuse) {
            object.x = albedo[p] * diffuse[p];
            object.y = albedo[size + p] * diffuse[size + p];
            object.z = albedo[2 * size + p] * diffuse[2 * size + p];
            object *= metallic ? 1.0f - metallic[p] : 1.0f;
        }
        if (specular)
            object.xyz += load_planes(specular, size, p);
        if (emission)
            object.xyz += load_planes(emission, size, p);
        if (maps)
            object.xyz = fmax(map_color(maps, TO_FRAME, object.xyz), 0.0f);
        object.w = 1.0f;
        background = a * object + (float4)(left, 1.0f) * background;
    }
    picture[i] = background; // pixels without an object keep their bits, whatever the other planes hold
}
