// Layout of everything that lives on the view: planes of float, one per channel, each with a
// border of PLANE_PAD pixels on all sides, so that filters read past the edge without clamping.
// The border of a depth plane is 0 ("nothing here") and stays so.
#ifndef IPRT_PLANES_H
#define IPRT_PLANES_H

// PLANE_PAD is set by -D from iprt.passes.layout.

static inline int plane_stride(int width) { return width + 2 * PLANE_PAD; }
static inline int plane_size(int width, int height) { return plane_stride(width) * (height + 2 * PLANE_PAD); }
static inline int plane_index(int x, int y, int width)
{
    return (y + PLANE_PAD) * plane_stride(width) + x + PLANE_PAD;
}

#endif
