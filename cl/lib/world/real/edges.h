// Depth edges of the panorama at subtexel precision, where texels mix the colors of two surfaces.
//
// In a window of 4x4 texels around a point, the gap nearest to the point separates two sides, the first and
// the second, in either order. Texels at gaps are mixed. The others of each side are pure, and their means
// are the two colors. A side too thin for pure texels has the color of its texel that differs most from
// the other side. The coverage of a mixed texel, its share of the first side, is the least-squares solution
// between the colors. The edge is the 1/2 isoline of bilinearly blended levels, a function of coverage.
//
// Element k of a vector of 16, and bit k of a mask, stand for the texel in row k / 4 and column k % 4.
#pragma once

#include "world/real/real.h"
#include "world/real/reconstruct.h"

#define FARTHEST_GAP 2.25f // squared distance limit of gaps, in texels
#define PRIOR 0.01f        // least weight of the expected coverage, over the square of the brightest color
#define MIXTURE 0.01f      // squared residual, over the squared contrast, at which a texel is half a mixture
#define ALIKE 1e-5f        // the same over the square of the brightest color
#define WHOLE 0.97f        // coverage from which a texel shows one side only
#define RADIUS 0.83f       // of a pixel's filter, in pixels
#define FADED 1e-3f        // least weight of a column or row
#define NEAR 0.1f          // squared distance in texels below which weights saturate
#define STEEP 2.25f        // change of coverage per share of neighbours on the first side

#define INNER 0x0660       // the four texels around the point
#define WITHOUT_LAST_COLUMN 0x7777
#define WITHOUT_LAST_ROW 0x0fff
#define NUMBERS ((int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))

typedef struct {
    int16 texels;
    float x, y;               // the point; 0: centres of the first column and row
    float4 across, down;      // weights of cubic convolution
    Shown shown;              // the picture
    float16 red, green, blue; // -D WIDE: its colors. GPUs have too few registers, and load them in each loop
} Window;

typedef struct {
    int east, south; // joined with the neighbour there
    int mixed;       // at a gap
} Joints;

// Return the value, hidden from compilers for GPUs. They then compute its sixteen results again for each use and
// do not keep them in registers.
static inline ALWAYS_INLINE int anew(int value)
{
#ifdef WIDE
    return value;
#else
    volatile int kept = value;
    return kept;
#endif
}

static inline ALWAYS_INLINE float sum_of(float16 v)
{
    const float8 eight = v.lo + v.hi;
    const float4 four = eight.lo + eight.hi;
    return four.x + four.y + four.z + four.w;
}

static inline ALWAYS_INLINE int16 in_mask(int mask)
{
    return ((int16)(anew(mask)) >> NUMBERS & 1) != 0;
}

// Return the union of `bits` over the elements where `is` holds.
static inline ALWAYS_INLINE int bits_where(int16 is, int16 bits)
{
    const int16 held = select((int16)(0), bits, is);
    const int8 eight = held.lo | held.hi;
    const int4 four = eight.lo | eight.hi;
    return four.x | four.y | four.z | four.w;
}

static inline ALWAYS_INLINE int mask_of(int16 is)
{
    return bits_where(is, (int16)(1) << NUMBERS);
}

// Return the index of the smallest element, all >= 0, compared to 19 bits; the first of equal ones.
static inline ALWAYS_INLINE int number_of_least(float16 v)
{
    const uint16 marked = (as_uint16(v) & ~15u) | as_uint16(NUMBERS);
    const uint8 eight = min(marked.lo, marked.hi);
    const uint4 four = min(eight.lo, eight.hi);
    return (int)(min(min(four.x, four.y), min(four.z, four.w)) & 15u);
}

// Return element k without an indexed array, which GPUs would put into memory.
static inline ALWAYS_INLINE float element(float16 v, int k)
{
    return sum_of(select((float16)(0.0f), v, NUMBERS == k));
}

// Return whether a texel is at a gap. Open sky is continuous with open sky.
static inline ALWAYS_INLINE int at_gap(int flags)
{
    const int all = SURFACE_EAST | SURFACE_WEST | SURFACE_NORTH | SURFACE_SOUTH;
    return !(flags & SURFACE_NONE) && (flags & all) != all;
}

static inline ALWAYS_INLINE Window window_at(int width, int height, float2 uv)
{
    const CubicTaps t = cubic_taps(width, height, uv);
    const Taps middle = equirect_taps(width, height, uv);
    const int4 columns = (int4)(t.left, t.a, t.b, t.right);
    Window w;
    w.texels = (int16)(t.above + columns, t.upper + columns, t.lower + columns, t.below + columns);
    w.x = 1.0f + middle.fx;
    w.y = 1.0f + middle.fy;
    w.across = (float4)(t.x.a, t.x.b, t.x.c, t.x.d);
    w.down = (float4)(t.y.a, t.y.b, t.y.c, t.y.d);
    return w;
}

// Return offsets from the texels' centres to the point.
static inline ALWAYS_INLINE float16 columns_away(const Window *w)
{
    return as_float(anew(as_int(w->x))) - convert_float16(NUMBERS & 3);
}

static inline ALWAYS_INLINE float16 rows_away(const Window *w)
{
    return as_float(anew(as_int(w->y))) - convert_float16(NUMBERS >> 2);
}

static inline ALWAYS_INLINE float16 cubic_weight(const Window *w)
{
    const float4 down = as_float4(as_int4(w->down) + anew(0));
    return w->across.xyzwxyzwxyzwxyzw * down.xxxxyyyyzzzzwwww;
}

static inline ALWAYS_INLINE Joints window_joints(__global const float4 *restrict surface, const Window *w)
{
#define FLAGS(k) (int)surface[w->texels.s##k].w
    const int16 flags = (int16)(FLAGS(0), FLAGS(1), FLAGS(2), FLAGS(3), FLAGS(4), FLAGS(5), FLAGS(6),
                                FLAGS(7), FLAGS(8), FLAGS(9), FLAGS(a), FLAGS(b), FLAGS(c), FLAGS(d),
                                FLAGS(e), FLAGS(f));
#undef FLAGS
    const int all = SURFACE_EAST | SURFACE_WEST | SURFACE_NORTH | SURFACE_SOUTH;
    const int none = mask_of((flags & SURFACE_NONE) != 0);
    int east = mask_of((flags & SURFACE_EAST) != 0) | (none & (none >> 1));
    int south = mask_of((flags & SURFACE_SOUTH) != 0) | (none & (none >> 4));
    // Beyond the poles, and in small panoramas, the window repeats texels.
    const int16 t = w->texels;
    east |= mask_of(t == t.s123456789abcdeff);
    south |= mask_of(t == t.s456789abcdefcdef);
    east &= WITHOUT_LAST_COLUMN;
    south &= WITHOUT_LAST_ROW;
    const int gap_east = ~east & WITHOUT_LAST_COLUMN, gap_south = ~south & WITHOUT_LAST_ROW;
    const int beside = gap_east | (gap_east << 1) | gap_south | (gap_south << 4);
    return (Joints){east, south, (mask_of((flags & all) != all) & ~none) | (none & beside)};
}

static inline ALWAYS_INLINE int grown(int side, Joints joints)
{
    return side | ((side & joints.east) << 1) | ((side >> 1) & joints.east)
        | ((side & joints.south) << 4) | ((side >> 4) & joints.south);
}

// Return the two sides of the gap nearest to the point; both 0 if no gap is within reach.
static inline ALWAYS_INLINE int2 sides_of_gap(const Window *w, Joints joints)
{
    const float16 x = columns_away(w), y = rows_away(w);
    const float16 aside = fmax(fabs(y) - 0.5f, 0.0f), along = fmax(fabs(x) - 0.5f, 0.0f);
    const float16 far = (float16)(FARTHEST_GAP);
    const float16 to_east = select(far, (x - 0.5f) * (x - 0.5f) + aside * aside,
                                   in_mask(~joints.east & WITHOUT_LAST_COLUMN));
    const float16 to_south = select(far, (y - 0.5f) * (y - 0.5f) + along * along,
                                    in_mask(~joints.south & WITHOUT_LAST_ROW));
    const int from = number_of_least(fmin(to_east, to_south));
    const float east = element(to_east, from), south = element(to_south, from);
    if (!(fmin(east, south) < FARTHEST_GAP))
        return (int2)(0);
    int first = 1 << from, second = east <= south ? 1 << (from + 1) : 1 << (from + 4);
    for (int i = 0; i < 4; i++) {
        first |= grown(first, joints) & ~second;
        second |= grown(second, joints) & ~first;
    }
    return (int2)(first, second);
}

static inline ALWAYS_INLINE float4 channel_of_row(Shown shown, int4 texels, int c)
{
    return (float4)(shown_texel(shown, texels.x, c), shown_texel(shown, texels.y, c),
                    shown_texel(shown, texels.z, c), shown_texel(shown, texels.w, c));
}

static inline ALWAYS_INLINE float16 channel(Shown shown, int16 t, int c)
{
    return (float16)(channel_of_row(shown, t.s0123, c), channel_of_row(shown, t.s4567, c),
                     channel_of_row(shown, t.s89ab, c), channel_of_row(shown, t.scdef, c));
}

// Set the picture whose colors the window shows.
static inline ALWAYS_INLINE void see(Window *w, Shown shown)
{
    w->shown = shown;
#ifdef WIDE
    w->red = channel(shown, w->texels, 0);
    w->green = channel(shown, w->texels, 1);
    w->blue = channel(shown, w->texels, 2);
#endif
}

// Return a channel of the colors. For loops over channels, which are not unrolled on GPUs (TAP_LOOP).
static inline ALWAYS_INLINE float16 seen(const Window *w, int c)
{
#ifdef WIDE
    return c == 0 ? w->red : c == 1 ? w->green : w->blue;
#else
    return channel(w->shown, w->texels + anew(0), c);
#endif
}

static inline ALWAYS_INLINE float channel_of(float3 color, int c)
{
    return c == 0 ? color.x : c == 1 ? color.y : color.z;
}

static inline ALWAYS_INLINE float3 with_channel(float3 color, int c, float value)
{
    return (float3)(c == 0 ? value : color.x, c == 1 ? value : color.y, c == 2 ? value : color.z);
}

// Return weights that vanish where texels leave the window, so that results are continuous there.
static inline ALWAYS_INLINE float16 fading(const Window *w)
{
    const float4 number = (float4)(0.0f, 1.0f, 2.0f, 3.0f);
    const float4 across = fmax(1.0f - 0.5f * fabs(as_float(anew(as_int(w->x))) - number), FADED);
    const float4 down = fmax(1.0f - 0.5f * fabs(w->y - number), FADED);
    return across.xyzwxyzwxyzwxyzw * down.xxxxyyyyzzzzwwww;
}

// Return the weighted sum of the window's colors.
static inline ALWAYS_INLINE float3 sum_of_colors(const Window *w, float16 weight)
{
    float3 sum = (float3)(0.0f);
    TAP_LOOP
    for (int c = 0; c < 3; c++)
        sum = with_channel(sum, c, sum_of(weight * seen(w, c)));
    return sum;
}

// Return the weighted mean color of the window.
static inline ALWAYS_INLINE float3 mean_color(const Window *w, float16 weight)
{
    return sum_of_colors(w, weight) / sum_of(weight);
}

// Return 1 in a mask, else 0.
static inline ALWAYS_INLINE float16 ones(int mask)
{
    return select((float16)(0.0f), (float16)(1.0f), in_mask(mask));
}

static inline ALWAYS_INLINE float16 squared_distance(const Window *w, float3 color)
{
    float16 sum = (float16)(0.0f);
    TAP_LOOP
    for (int c = 0; c < 3; c++) {
        const float16 away = seen(w, c) - channel_of(color, c);
        sum += away * away;
    }
    return sum;
}

// Return a mask of the texel in `mask` whose color is farthest from `from`.
static inline ALWAYS_INLINE int farthest_color(const Window *w, int mask, float3 from)
{
    const float16 near = 1.0f / (squared_distance(w, from) + FLT_MIN);
    return 1 << number_of_least(select((float16)(INFINITY), near, in_mask(mask)));
}

// Return the pure texels of each side; 0 if neither side has any.
static inline ALWAYS_INLINE int2 pure_texels(const Window *w, int2 sides, int mixed)
{
    int2 pure = sides & ~mixed;
    if (pure.x && !pure.y)
        pure.y = farthest_color(w, sides.y, mean_color(w, ones(pure.x)));
    else if (pure.y && !pure.x)
        pure.x = farthest_color(w, sides.x, mean_color(w, ones(pure.y)));
    return pure;
}

// Return the mean color of a side's pure texels, and their variance.
static inline ALWAYS_INLINE float3 side_mean(const Window *w, int pure, float *variance)
{
    const float16 weight = ones(pure) * fading(w);
    const float3 mean = mean_color(w, weight);
    *variance = sum_of(weight * squared_distance(w, mean)) / sum_of(weight);
    return mean;
}

// Return the coverage expected of an inner texel from the sides of its neighbours: a straight edge.
static inline ALWAYS_INLINE float expected_coverage(int first, int k)
{
    return 0.5f + STEEP * (popcount(first >> (k - 5) & 0x777) / 9.0f - 0.5f);
}

// Return the coverage of the window's texels by the first side: least squares between two colors, which
// count more the less they vary. A texel's coverage is at least 1/2 on its own side. `mixtures` gets how
// well mixtures of both colors explain the texels at the point, 1 to 0.
static inline ALWAYS_INLINE float16 find_coverage(
    const Window *w, int first, int2 pure, int mixed, float *mixtures)
{
    float variance, other_variance;
    const float3 one = side_mean(w, pure.x, &variance), other = side_mean(w, pure.y, &other_variance);
    const float3 apart = one - other, bright = fmax(one, other);
    const float prior = variance + other_variance + PRIOR * dot(bright, bright) + FLT_MIN;
    const float contrast = dot(apart, apart);
    const float16 own = ones(first);
    float16 expected = own;
    expected.s5 = expected_coverage(first, 5);
    expected.s6 = expected_coverage(first, 6);
    expected.s9 = expected_coverage(first, 9);
    expected.sa = expected_coverage(first, 10);
    float16 along = prior * expected;
    TAP_LOOP
    for (int c = 0; c < 3; c++)
        along += (seen(w, c) - channel_of(other, c)) * channel_of(apart, c);
    const float16 share = along / (contrast + prior);
    const float16 coverage =
        select(own, clamp(share, 0.5f * own, 0.5f + 0.5f * own), in_mask(mixed));
    float4 left = (float4)(0.0f);   // of the inner texels
    TAP_LOOP
    for (int c = 0; c < 3; c++) {
        const float4 away = seen(w, c).s569a - channel_of(other, c) - coverage.s569a * channel_of(apart, c);
        left += away * away;
    }
    const float x = w->x - 1.0f, y = w->y - 1.0f;
    const float off = mix(mix(left.x, left.y, x), mix(left.z, left.w, x), y);
    const float enough = MIXTURE * contrast + ALIKE * dot(bright, bright) + FLT_MIN;
    const float relative = off / enough;
    *mixtures = fmax(1.05f / (1.0f + relative * relative) - 0.05f, 0.0f);
    return coverage;
}

// Return levels of coverages, blended between texels' centres so that 1/2 is on the edge: an edge along the
// grid cuts a texel of coverage f at f - 1/2 from its centre. Blended coverages themselves would put the
// edge there for f of 0, 1/2 and 1 alone.
static inline ALWAYS_INLINE float4 edge_level(float4 coverage)
{
    const float4 less = fmin(coverage, 1.0f - coverage);
    const float4 level = 2.0f * less / (1.0f + 2.0f * less);
    return select(1.0f - level, level, coverage < 0.5f);
}

// Return the share of a pixel on the first side of the edge. The filter is isotropic and falls as a
// parabola across the edge. `right`, `down`: extent of the pixel, in texels.
static inline ALWAYS_INLINE float pixel_coverage(
    const Window *w, float16 coverage, float2 right, float2 down)
{
    const float x = w->x - 1.0f, y = w->y - 1.0f;
    const float4 level = edge_level(coverage.s569a);
    const float upper = mix(level.x, level.y, x), lower = mix(level.z, level.w, x);
    const float along_x = mix(level.y - level.x, level.w - level.z, y);
    const float along_y = lower - upper;
    const float across = length((float2)(along_x * right.x + along_y * right.y,
                                         along_x * down.x + along_y * down.y));
    return smoothstep(-RADIUS, RADIUS, (mix(upper, lower, y) - 0.5f) / fmax(across, 1e-6f));
}

// Return the pure texels, and the mixed ones that were found to be covered by their side alone.
static inline ALWAYS_INLINE int2 whole_texels(int2 sides, int2 pure, float16 coverage)
{
    return pure | (sides & (int2)(mask_of(coverage > WHOLE), mask_of(coverage < 1.0f - WHOLE)));
}

static inline ALWAYS_INLINE float16 squared_way(const Window *w)
{
    const float16 x = columns_away(w), y = rows_away(w);
    return x * x + y * y;
}

// Return the color of a side at the point by cubic convolution, with the other side's texels extrapolated
// from this side's, weighted by nearness.
static inline ALWAYS_INLINE float3 side_color(const Window *w, int own)
{
    const float16 is = ones(own), known = is * cubic_weight(w);
    const float16 near = is * fading(w) / (NEAR + squared_way(w));
    const float left = (1.0f - sum_of(known)) / sum_of(near);
    const float16 weight = known + left * near;
    return fmax(sum_of_colors(w, weight), 0.0f);
}

// Return the texel of a mask nearest to the point.
static inline ALWAYS_INLINE int nearest_texel(const Window *w, int mask)
{
    const float16 way = select((float16)(INFINITY), squared_way(w), in_mask(mask));
    return bits_where(NUMBERS == number_of_least(way), w->texels);
}

// Return the first side's share in the window's cubic convolution.
static inline ALWAYS_INLINE float blurred_coverage(const Window *w, float16 coverage)
{
    return clamp(sum_of(cubic_weight(w) * coverage), 0.0f, 1.0f);
}
