// Lists the tiles of a view on which image-space passes work (batch.h), and gathers the guide (guide.h) there:
// seven planes of features by which these passes compare pixels. Listed are tiles that show a layer's surfaces,
// and in layers that may sleep only tiles on which objects have a visible influence.
//
// Pixel (x, y) has its centre at (x + 0.5, y + 0.5); row 0 is the top. Tiles are numbered row by row. World:
// +Y up, metres, origin at the capture centre.
//
//   kernel        in                                           out
//   scan_tiles    depth (1 plane, m, 0 = no surface),          seen: whether a row of a tile shows
//                 id (1 plane, 0 = nothing to trace)           surfaces; empty lists
//   list_tiles    seen, motion, influence of the last picture  lists, states, influence carried over
//   build_guide   normal (3 planes), depth, id, lists          guide (7); id 0 without depth
//
// A tile stays listed for two pictures after its last surface, or after it fell asleep: passes then
// write 0, also with double buffers.
#include "gbuffer/tiles.h"
#include "gbuffer/view.h"
#include "maths/lanes.h"

__kernel void scan_tiles(
    PLANES_IN depth[MOST_ENTRIES],               // radial distance in metres, 0 = no surface
    PLANES_IN id[MOST_ENTRIES],                  // 0 = nothing to trace, else the surface's id
    const int layer[MOST_ENTRIES],
    __global uchar *restrict seen,               // out: per layer, row of pixels, and column of tiles
    __global int *restrict tiles,                // out: lengths of the lists
    int width,
    int height)
{
    const int column = get_global_id(0), y = get_global_id(1), across = tiles_across(width);
    if (column >= across || y >= height)
        return;
    if (column == 0 && y == 0)
        tiles[layer * (tiles_of(width, height) + 1)] = 0;
    int any = 0;
    for (int x = column * TILE; x < min((column + 1) * TILE, width); x++) {
        const int p = plane_index(x, y, width);
        any |= depth[p] > 0.0f && id[p] > 0.0f;
    }
    seen[(layer * height + y) * across + column] = any;
}

// Return whether a tile of a layer shows surfaces. Tiles outside the picture do not.
static inline int shows(__global const uchar *restrict seen, int layer, int column, int row, int width,
                        int height, int seam)
{
    const int across = tiles_across(width);
    column = seam ? (column + across) % across : column;
    if (column < 0 || column >= across || row < 0)
        return 0;
    int any = 0;
    for (int y = row * TILE; y < min((row + 1) * TILE, height); y++)
        any |= seen[(layer * height + y) * across + column];
    return any;
}

// Largest influence in the last picture on the surfaces of a tile, and in the tiles around these; infinite
// where the last picture did not show all of them.
typedef struct {
    float on;
    float around;
} Influence;

static inline Influence influence_before(
    PLANES_IN depth, PLANES_IN id, PLANES_IN motion, __global const float *restrict before, int column,
    int row, int width, int height, int seam)
{
    const int size = plane_size(width, height), across = tiles_across(width);
    const int down = tiles_of(width, height) / across;
    int4 box = (int4)(across, down, -1, -1);
    for (int i = 0; i < SAMPLES * SAMPLES; i++) {
        const int x = min(column * TILE + (2 * (i % SAMPLES) + 1) * TILE / (2 * SAMPLES), width - 1);
        const int y = min(row * TILE + (2 * (i / SAMPLES) + 1) * TILE / (2 * SAMPLES), height - 1);
        const int p = plane_index(x, y, width);
        if (!(depth[p] > 0.0f && id[p] > 0.0f))
            continue;
        const float mx = motion[p], my = motion[size + p];
        const int found = fabs(mx) < 1e6f && my >= 0.0f && my < height;
        const int there = found ? wrap_column((int)floor(mx), width, seam) : -1;
        if (there < 0 || there >= width)
            return (Influence){INFINITY, INFINITY};
        const int2 tile = (int2)(there, (int)my) / TILE;
        box = (int4)(min(box.xy, tile), max(box.zw, tile));
    }
    Influence found = {0.0f, 0.0f};
    for (int y = max(box.y - 1, 0); y <= min(box.w + 1, down - 1); y++)
        for (int x = box.x - 1; x <= box.z + 1; x++) {
            const int wrapped = seam ? (x + across) % across : x;
            if (wrapped < 0 || wrapped >= across)
                continue;
            const float value = before[y * across + wrapped];
            const int inside = x >= box.x && x <= box.z && y >= box.y && y <= box.w;
            found.on = inside ? fmax(found.on, value) : found.on;
            found.around = fmax(found.around, value);
        }
    return found;
}

__kernel void list_tiles(
    PLANES_IN depth[MOST_ENTRIES],
    PLANES_IN id[MOST_ENTRIES],
    PLANES_IN motion[MOST_ENTRIES],              // previous pixel, 2 planes; -1e9 = nowhere
    const int layer[MOST_ENTRIES],
    const int sleeps[MOST_ENTRIES],              // tiles without influence may sleep
    const int objects,                           // layer of the objects: tiles around them are awake
    const float least,                           // influence that is visible, in radiance
    const int wake,                              // all tiles are awake in this picture
    __global const uchar *restrict seen,
    __global const float *restrict before,       // influence after the last picture, per layer and tile
    __global float *restrict influence,          // out: the same of this picture's tiles
    __global int *restrict states,               // in, out: per layer and tile, tiles.h
    __global int *restrict tiles,                // out: lists
    int width,
    int height,
    int seam)
{
    const int column = get_global_id(0), row = get_global_id(1), across = tiles_across(width);
    const int count = tiles_of(width, height);
    if (column >= across || row * across >= count)
        return;
    const int tile = row * across + column, own = layer * count + tile;
    const int shown = shows(seen, layer, column, row, width, height, seam);
    int awake = shown;
    if (sleeps)
        influence[own] = 0.0f;
    if (shown && sleeps) {
        const Influence last = influence_before(depth, id, motion, before + layer * count, column, row,
                                                width, height, seam);
        int near = 0;
        for (int i = 0; i < 9; i++)
            near |= shows(seen, objects, column + i % 3 - 1, row + i / 3 - 1, width, height, seam);
        awake = wake || near || last.on > least || last.around > SPREADING * least;
        const float known = last.on < INFINITY ? last.on : 0.0f;
        influence[own] = awake ? FORGET * known : known;
    }
    const int left = awake ? LISTED_FRAMES : max((states[own] & LEFT) - 1, 0);
    states[own] = left | (shown && !awake ? ASLEEP : 0);
    if (left > 0) {
        __global int *list = tiles + layer * (count + 1);
        list[1 + atomic_inc(list)] = tile;
    }
}

__kernel void build_guide(
    __global const float *restrict view,            // projection and rotation, view.h
    PLANES_IN normal[MOST_ENTRIES],              // world-space unit normals, 3 planes
    PLANES_IN depth[MOST_ENTRIES],               // radial distance in metres, 0 = no surface
    PLANES_IN id[MOST_ENTRIES],                  // 0 = nothing to trace, else the surface's id
    __global const int *restrict tiles,
    const int layer[MOST_ENTRIES],
    __global const int *restrict states,
    PLANES_OUT guide[MOST_ENTRIES],              // out: 7 planes
    int width,
    int height,
    int seam)
{
    TILE_LANES_ITEM;
    const int size = plane_size(width, height);
    const int awake = is_awake(states[layer * tiles_of(width, height) + tile]);
    LANE_LOOP
    for (int x = first; x < end; x++) {
        const int p = plane_index(x, y, width);
        const float3 direction = direction_unbranched(view, (float2)(x + 0.5f, y + 0.5f));
        const float radius = depth[p];
        guide[p] = normal[p];
        guide[size + p] = normal[size + p];
        guide[2 * size + p] = normal[2 * size + p];
        guide[GUIDE_POSITION * size + p] = radius * direction.x;
        guide[(GUIDE_POSITION + 1) * size + p] = radius * direction.y;
        guide[(GUIDE_POSITION + 2) * size + p] = radius * direction.z;
        const float shown = radius > 0.0f ? fmax(id[p], 0.0f) : 0.0f;
        guide[GUIDE_ID * size + p] = awake | !(shown > 0.0f) ? shown : SLEEPING;
    }
    for (int c = 0; c < GUIDE_PLANES; c++)
        wrap_row(guide + c * size, first, end, y, width, seam);
}
