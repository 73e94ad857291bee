// Rays behind the first layer, where the video has shown surfaces. Included by real.h.
//
// A texel with a hidden background has two surfaces: the first layer, with the assumed thickness but no
// thicker than the gap to the background, and the background. In all other texels the two coincide, but
// their joins differ: the floor that a ball hides continues beside it, while the ball ends there. Both
// surfaces are watertight across joined edges. No back faces are assumed (BASSRT) where the background is
// known.
#pragma once



#ifdef BACKGROUND
// Return where a radius lies in a texel: 0 before the first layer, 1 in it, 2 between, 3 in the background,
// 4 behind.
static inline int place_of(float r, float front, float solid, float back, float back_solid)
{
    return (r > front) + (r > front + solid) + (r > back) + (r > back + back_solid);
}

static inline int side_of(int place)
{
    return place == 0 ? SIDE_FRONT
        : place == 2  ? SIDE_BETWEEN
        : place == 4  ? SIDE_BEHIND
                      : SIDE_WITHIN;
}

// Intersect a ray with a texel that has a hidden background. `edge` is the flag of the edge that the ray
// entered by. Otherwise as real_leaf().
static inline int hidden_leaf(const RealLayer layer, const PolarRay ray, const Segment at, int edge,
                              float4 front, float4 back, int *side, RealHit *hit)
{
    const float2 front_range = layer.grid.range[hit->texel];
    const float2 back_range = layer.background.range[hit->texel];
    const float front_m = dot(front.xyz, ray.m), front_d = dot(front.xyz, ray.d);
    const float back_m = dot(back.xyz, ray.m), back_d = dot(back.xyz, ray.d);
    const float f0 = surface_radius(front_m, front_d, at.u0, at.root0, front_range);
    const float f1 = surface_radius(front_m, front_d, at.u1, at.root1, front_range);
    const float b0 = surface_radius(back_m, back_d, at.u0, at.root0, back_range);
    const float b1 = surface_radius(back_m, back_d, at.u1, at.root1, back_range);
    const float solid0 = clamp(b0 - f0, 0.0f, real_thickness(layer, f0));
    const float solid1 = clamp(b1 - f1, 0.0f, real_thickness(layer, f1));
    const float r0 = ray.b * at.root0, r1 = ray.b * at.root1;
    const int in = place_of(r0, f0, solid0, b0, real_thickness(layer, b0));
    const int out = place_of(r1, f1, solid1, b1, real_thickness(layer, b1));
    const int front_joined = (int)front.w & edge, back_joined = (int)back.w & edge;
    const int before = *side;

    int met_front = 0, met_back = 0;
    float u = at.u0;
    hit->kind = HIT_SURFACE;
    if (at.entry == ENTRY_START) {
        // A start just below a surface counts as on it: the ray hits if it heads deeper.
        met_front = in == 1 && r0 - f0 <= layer.bias && r1 - f1 > r0 - f0;
        met_back = in == 3 && r0 - b0 <= layer.bias && r1 - b1 > r0 - b0;
    } else if (before == SIDE_FRONT && in > 0 && front_joined) {
        met_front = 1;
    } else if (before != SIDE_WITHIN) {
        const int deep = before == SIDE_BEHIND;
        met_front = in == 1
            || (in == 0 && before != SIDE_FRONT && (front_joined || (deep && back_joined)));
        met_back = in == 3 || (in == 2 && deep && back_joined) || (in == 4 && !deep && back_joined);
        if (met_front || deep || !back_joined)
            hit->kind = HIT_SIDE;
    }
    *side = side_of(in);

    if (!met_front && !met_back) {
        hit->kind = HIT_SURFACE;
        const int from = *side;
        const float front_u = (1.0f / ray.b - front_m) / front_d;
        const float back_u = (1.0f / ray.b - back_m) / back_d;
        u = at.u1;
        if (from == SIDE_FRONT && out > 0) {
            met_front = 1;
            u = front_u >= at.u0 && front_u <= at.u1 ? front_u : at.u1;
        } else if ((from == SIDE_BETWEEN || (from == SIDE_WITHIN && in == 1)) && out > 2) {
            met_back = 1;
            u = back_u >= at.u0 && back_u <= at.u1 ? back_u : at.u1;
        } else if ((from == SIDE_BETWEEN || (from == SIDE_WITHIN && in == 3)) && out < 2) {
            met_front = 1;
            hit->kind = HIT_SIDE;
        } else if (from == SIDE_BEHIND && out < 4) {
            met_back = 1;
            hit->kind = HIT_SIDE;
        } else {
            *side = side_of(out);
        }
    }
    if (!met_front && !met_back)
        return 0;
    meet_at(ray, u, hit);
    hit->behind = met_back;
    return 1;
}

// Intersect a ray that starts behind the first layer and heads away from the capture centre.
static inline int radial_background(const RealLayer layer, const PolarRay ray, int texel,
                                    RealHit *hit)
{
    const float4 back = layer.background.surface[texel];
    if (!((int)back.w & SURFACE_HIDDEN))
        return -1;
    const float radius =
        surface_radius(0.0f, dot(back.xyz, ray.d), 1.0f, 1.0f, layer.background.range[texel]);
    if (!isfinite(radius))
        return 0;
    if (ray.od > radius + layer.bias)
        return -1;
    hit->kind = HIT_SURFACE;
    hit->t = fmax(radius - ray.od, 0.0f);
    hit->direction = ray.d;
    hit->radius = ray.od + hit->t;
    hit->behind = 1;
    return 1;
}

// Return whether a surface stands before open sky in this texel.
static inline int sky_behind(const RealLayer layer, int texel)
{
    const int flags = (int)layer.background.surface[texel].w;
    return flags & SURFACE_HIDDEN && flags & SURFACE_NONE;
}

#endif
