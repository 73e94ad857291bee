// How many rays pixels send: those of objects several in a frame, those of real surfaces one.
#ifndef IPRT_RAYS_H
#define IPRT_RAYS_H

// Pixels whose history is worth more frames send this share of `rays` only, but one. Those that send
// one do so in four frames of sixteen (filter/mask.cl).
#define SETTLED_HISTORY 7.5f
#define SETTLED_SHARE 0.25f

static inline float share_of_rays(float history, int rays)
{
    return history < SETTLED_HISTORY ? 1.0f : fmax(SETTLED_SHARE, 1.0f / rays);
}

#endif
