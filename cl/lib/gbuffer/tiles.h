// States of the tiles of a layer. A tile is awake while passes work on it. In layers of real surfaces, tiles
// on which objects have no visible influence fall asleep: passes find no surfaces there, so that their
// pixels keep the panorama's radiance, and a few probes a frame look for influence.
#pragma once

#include "gbuffer/batch.h"
#include "gbuffer/guide.h"

#define LISTED_FRAMES 3 // pictures, from the last one awake on, in which passes still work on a tile
#define LEFT 3          // bits of a state that count these pictures; all of them: awake
#define ASLEEP 4        // shows surfaces, which sleep

#define SAMPLES 4       // pixels along a tile's side that are looked up in the last picture
#define PROBES 2        // probes of a sleeping tile in each frame
#define PROBE_SHARE 0.125f // share of a frame in the mean of a tile's probes
#define PROBE_TRUST 0.5f   // weight of this mean, so that tiles do not wake and fall asleep in turn
#define SPREADING 4.0f     // times the visible influence: the tiles around are awake, too
#define FORGET 0.7f     // share of the influence on an awake tile that is remembered in the next frame

static inline int is_awake(int state) { return (state & LEFT) == LISTED_FRAMES; }
