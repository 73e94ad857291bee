// Batched launches: up to three layers or signals at once, along the third dimension of the grid. A frame
// of few pixels is bound by the number of launches. Each entry has its own buffers. Kernels declare
// parameters NAME[MOST_ENTRIES], of which NAME is the work item's (iprt/device/block.py).
#pragma once

#define MOST_ENTRIES 3

#define PLANES_IN __global const float *restrict
#define PLANES_OUT __global float *restrict

// Kernels run over listed tiles (gbuffer/guide.cl) of TILE x TILE pixels. `tiles` holds the lists of all
// layers, one buffer: CPU compilers do not vectorize accesses to further buffers unless they know that
// nothing aliases them. A launch has TILE x (TILE * tiles of the picture) work items for each `entry`, whose
// `layer` chooses the list.
#define TILE 16

static inline int tiles_across(int width) { return (width + TILE - 1) / TILE; }
static inline int tiles_of(int width, int height)
{
    return tiles_across(width) * ((height + TILE - 1) / TILE);
}

// Return the list of a layer: its length, then the tiles, numbered row by row.
static inline __global const int *tile_list(__global const int *tiles, int layer, int width, int height)
{
    return tiles + layer * (tiles_of(width, height) + 1);
}

// Return the place in a list of tile `t` of a grid of `tiles`. A list rarely fills its grid. CPU runtimes give
// each thread long ranges of groups, of which the first would otherwise get all the work. A launch may be
// part of a grid (iprt/device/bands.py), so that its size is not the grid's.
#define RUNS 16
static inline int spread_place(int t, int tiles)
{
    const int share = tiles / RUNS;
    return t < RUNS * share ? t % RUNS * share + t / RUNS : t;
}

// Define the pixel x, y of a work item inside a listed tile; the others return. A group beyond the list
// returns by a condition uniform over its items: with a condition per item, vectorized groups would run on.
#define TILE_ITEM                                                                                  \
    const int place = spread_place(((int)get_global_id(1) - (int)get_local_id(1)) / TILE,          \
                                   tiles_of(width, height));                                       \
    __global const int *restrict listed = tile_list(tiles, layer, width, height);                  \
    if (place >= listed[0])                                                                        \
        return;                                                                                    \
    const int tile = listed[1 + place];                                                            \
    const int x = tile % tiles_across(width) * TILE + (int)get_global_id(0);                       \
    const int y = tile / tiles_across(width) * TILE + (int)get_global_id(1) % TILE;                \
    if (x >= width || y >= height)                                                                 \
        return

// The same for kernels of lanes (maths/lanes.h): define row y and columns `first` to `end` of a work item. With
// -D WIDE a work item has a row of a tile, and a launch TILE x (tiles of the picture) of them.
#ifdef WIDE
#define TILE_LANES_ITEM                                                                            \
    const int place = spread_place(get_global_id(1), tiles_of(width, height));                     \
    __global const int *restrict listed = tile_list(tiles, layer, width, height);                  \
    if (place >= listed[0])                                                                        \
        return;                                                                                    \
    const int tile = listed[1 + place], first = tile % tiles_across(width) * TILE;                 \
    const int end = min(first + TILE, width);                                                      \
    const int y = tile / tiles_across(width) * TILE + (int)get_global_id(0);                       \
    if (y >= height)                                                                               \
        return
#else
#define TILE_LANES_ITEM                                                                            \
    TILE_ITEM;                                                                                     \
    const int first = x, end = x + 1
#endif
