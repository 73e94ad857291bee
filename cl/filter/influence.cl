// Influence of the objects on the tiles of a layer of real surfaces. In tiles that are awake: the largest mean
// change of radiance in a row of pixels, which has less noise than single pixels'. In sleeping ones: a running
// mean of the changes found by probes. Probes are traced pixels of which nothing else is known.
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top.
//
//   kernel          in                                         out
//   place_probes    states, normal (3), depth, id, list of     probes; guide at their pixels, with a
//                   traced pixels                              negative id; list with them added
//   judge           states, probes, picture and samples of     influence
//                   the change
#include "gbuffer/tiles.h"
#include "gbuffer/view.h"
#include "maths/rng.h"

__kernel void place_probes(
    __global const float *restrict view,         // projection and rotation, view.h
    PLANES_IN normal[MOST_ENTRIES],              // world-space unit normals, 3 planes
    PLANES_IN depth[MOST_ENTRIES],               // radial distance in metres, 0 = no surface
    PLANES_IN id[MOST_ENTRIES],                  // 0 = nothing to trace, else the surface's id
    const int layer[MOST_ENTRIES],
    __global const int *restrict states,
    const int frame,
    PLANES_OUT guide[MOST_ENTRIES],              // in, out: 7 planes
    __global int *restrict list[MOST_ENTRIES],   // in, out: pixels that get a ray
    __global int *restrict count[MOST_ENTRIES],  // in, out: length of the list
    __global int *restrict probes,               // out: per layer and tile, indices of pixels; -1: none
    int width,
    int height)
{
    const int column = get_global_id(0), row = get_global_id(1), across = tiles_across(width);
    const int all = tiles_of(width, height), own = layer * all + row * across + column;
    if (column >= across || row * across >= all)
        return;
    const int size = plane_size(width, height);
    uint seed = hash_combine((uint)own, (uint)frame);
    for (int i = 0; i < PROBES; i++) {
        seed = hash_combine(seed, (uint)i);
        const int x = column * TILE + (int)(seed % TILE), y = row * TILE + (int)(seed / TILE % TILE);
        const int p = plane_index(x, y, width);
        const int used = (states[own] & ASLEEP) && x < width && y < height && depth[p] > 0.0f
                         && id[p] > 0.0f;
        probes[PROBES * own + i] = used ? p : -1;
        if (!used)
            continue;
        store_planes(guide + GUIDE_NORMAL * size, size, p, load_planes(normal, size, p));
        store_planes(guide + GUIDE_POSITION * size, size, p,
                     depth[p] * view_direction(view, (float2)(x + 0.5f, y + 0.5f)));
        guide[GUIDE_ID * size + p] = -id[p];
        list[atomic_inc(count)] = y * width + x;
    }
}

// Return the mean of a tile's probes with another frame's added: `found` is their sum of `number`.
static inline float with_probes(float mean, float found, int number)
{
    return number > 0 && found < INFINITY ? mean + PROBE_SHARE * (PROBE_TRUST * found / number - mean)
                                         : mean;
}

static inline float largest(float3 v)
{
    const float3 a = fabs(v);
    return fmax(a.x, fmax(a.y, a.z));
}

// Raise the influence on an awake tile to `most`, by atomics: positive floats are ordered like integers.
static inline void raise(__global float *influence, float most)
{
    if (most > 0.0f && most < INFINITY)
        atomic_max((__global int *)influence, as_int(most));
}

// Work item: a row of pixels of a tile. The change of a layer is relative to the camera's picture, or, where
// `ratio` is null, itself radiance.
__kernel void judge(
    __global const int *restrict states,
    __global const int *restrict probes,
    const int layer[MOST_ENTRIES],
    __global const float4 *restrict ratio[MOST_ENTRIES], // per pixel, without border
    PLANES_IN color[MOST_ENTRIES],               // 3 planes, L_cam; not without ratio
    PLANES_IN change[MOST_ENTRIES],              // 3 planes, filtered; only without ratio
    PLANES_IN signal[MOST_ENTRIES],              // of traced pixels: 6 planes, blocked, bounce / E_R; without
                                                 // ratio 3
    __global float *influence,                   // in, out
    int width,
    int height)
{
    const int column = get_global_id(0), y = get_global_id(1), across = tiles_across(width);
    const int all = tiles_of(width, height), own = layer * all + y / TILE * across + column;
    if (column >= across || y >= height)
        return;
    const int size = plane_size(width, height);
    if (is_awake(states[own])) {
        float3 sum = (float3)(0.0f);
        for (int x = column * TILE; x < min((column + 1) * TILE, width); x++) {
            const int p = plane_index(x, y, width);
            sum += ratio ? load_planes(color, size, p) * (ratio[y * width + x].xyz - 1.0f)
                         : load_planes(change, size, p);
        }
        raise(influence + own, largest(sum) / TILE);
    } else if (y % TILE == 0 && (states[own] & ASLEEP)) {
        float found = 0.0f;
        int number = 0;
        for (int i = 0; i < PROBES; i++) {
            const int p = probes[PROBES * own + i];
            if (p < 0)
                continue;
            float3 sample = load_planes(signal, size, p);
            if (ratio)
                sample = load_planes(color, size, p) * (load_planes(signal + 3 * size, size, p) - sample);
            found += largest(sample);
            number++;
        }
        influence[own] = with_probes(influence[own], found, number);
    }
}
