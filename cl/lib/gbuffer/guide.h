// The guide of a layer: the features by which image-space passes compare pixels. Seven padded planes
// (planes.h), written by guide.cl: normal x y z, world position x y z (metres from the capture centre), id.
// id > 0: a surface; 0: nothing to trace; -1: outside the picture; other negative ones: asleep (tiles.h). In
// equirect views the left and right border hold copies from across the seam, so neighbours need no wrapping.
#pragma once

#include "maths/maths.h"
#include "gbuffer/planes.h"

#define GUIDE_NORMAL 0
#define GUIDE_POSITION 3
#define GUIDE_ID 6
#define GUIDE_PLANES 7

#define SLEEPING -2.0f // id of pixels that sleep

// Tracing levels beyond 0, 1, 2: a pixel of level 0 that waits for its turn because its history is long
// enough; nothing to trace.
#define LEVEL_WAITING 3
#define LEVEL_NONE 255

// Frames, the traced one included, for which the influence of an object on a pixel is remembered, and for
// which a strong one is where weakly affected pixels are distinguished.
#define TOUCHED_FRAMES 11.0f
#define STRONG_FRAMES 21.0f

// Return the spacing in pixels of the rays at a tracing level (IPRT Eq. 4 and Figure 5).
static inline int level_spacing(int level) { return level == LEVEL_WAITING ? 2 : 1 << level; }

// Return whether the pixel (x, y), relative to the origin of this frame's grid, gets a ray.
static inline bool is_traced(int level, int x, int y)
{
    return level < LEVEL_WAITING && ((x | y) & (level_spacing(level) - 1)) == 0;
}

// Return the column of a neighbour, wrapped around the seam in equirect views, whose `seam` (planes.h) is
// not 0. It is less than a turn outside the picture, except in views narrower than their border.
static inline int wrap_column(int x, int width, int seam)
{
    const int turn = seam ? width : 0;
#ifdef VIEW_NARROW
    x = seam ? x % width : x;
#endif
    return x < 0 ? x + turn : x >= width ? x - turn : x;
}
