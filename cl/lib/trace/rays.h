// Number of rays that a pixel sends in a frame: several at objects, one at real surfaces.
#pragma once

// Pixels with a longer history, in frames, send this share of `rays`, at least one. Pixels that send a
// single ray do so in four frames of sixteen (filter/mask.cl).
#define SETTLED_HISTORY 7.5f
#define SETTLED_SHARE 0.25f

static inline float share_of_rays(float history, int rays)
{
    return history < SETTLED_HISTORY ? 1.0f : fmax(SETTLED_SHARE, 1.0f / rays);
}
