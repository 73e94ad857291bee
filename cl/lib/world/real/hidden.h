// Surfaces that the frame hides, where the video has shown them before. Included by real.h.
//
// Models of learned radiance (learned.h) lie on surfaces that earlier frames have shown, of a camera
// that may have moved since. Where a ray passes behind the first layer, nothing is known but these: it
// meets the first model whose plane it crosses from the front, near enough to be asked, if the frame
// hides that place.
#ifndef IPRT_HIDDEN_H
#define IPRT_HIDDEN_H

// A ray looks for models in so many cells of their grid at most.
#define HIDDEN_CELL_CAP 256
// Cosine between a ray and a plane, or the direction from the capture centre, from which on one has
// another's side before it.
#define HIDDEN_FACING 0.05f

// What happens to a ray in one texel, and where it first passes behind the first layer. The first back
// face that is assumed is kept, and the ray goes on: what was seen behind it counts more.
static inline int noted_leaf(const RealLayer layer, const PolarRay ray, const Segment at, int *side,
                             RealHit *hit)
{
    int found = real_leaf(layer, ray, at, side, hit);
    if (found ? hit->kind != HIT_SURFACE : *side == SIDE_BEHIND || *side == SIDE_BETWEEN)
        hit->hidden_from = fmin(hit->hidden_from, fmax(polar_t(ray, at.u0), 0.0f));
    if (found && hit->kind == HIT_BACK_FACE) {
        if (!(hit->assumed.t < INFINITY)) {
            hit->assumed.t = hit->t;
            hit->assumed.direction = hit->direction;
            hit->assumed.texel = hit->texel;
        }
        *side = SIDE_BEHIND;
        found = 0;
    }
    return found;
}

// Does the frame hide the point p of a surface with normal n, both in the axes of the capture centre?
// A side that faces away may lie within the assumed thickness of what it is the back of.
static inline int frame_hides(const RealLayer layer, float3 p, float3 n)
{
    const float r = length(p);
    const float3 v = p / r;
    const int texel = texel_towards(layer, v);
    const float4 surface = layer.surface[texel];
    if ((int)surface.w & (SURFACE_NONE | SURFACE_OPENING))
        return 0;
    const float front =
        surface_radius(0.0f, dot(surface.xyz, v), 1.0f, 1.0f, layer.grid.range[texel]);
#ifdef BACKGROUND
    // What is remembered is met by the march.
    const float4 back = layer.back_surface[texel];
    if ((int)back.w & SURFACE_HIDDEN) {
        const float radius =
            surface_radius(0.0f, dot(back.xyz, v), 1.0f, 1.0f, layer.back_range[texel]);
        if (!(r < radius - real_thickness(layer, radius)))
            return 0;
    }
#endif
    return r - front > (dot(n, v) > HIDDEN_FACING ? 0.0f : real_thickness(layer, front));
}

// The first learned surface behind the first layer, before what the march has found, or before t_last.
// Returns 1 and the hit if there is one.
static inline int hidden_surface(const RealLayer layer, float3 o, float3 d, int found, float t_last,
                                 RealHit *hit)
{
    const Learned learned = layer.learned;
    if (!(hit->hidden_from < INFINITY && learned.inverse_radius > 0.0f))
        return 0;
    // The assumed thickness of what was met from behind begins before its true back.
    float t_end = t_last;
    if (found && hit->kind == HIT_SURFACE)
        t_end = hit->t;
    else if (found)
        t_end = fmin(t_last, hit->t + real_thickness(layer, length(o + hit->t * d)));
    const float3 from = to_world(learned.pose, o, 1.0f), along = to_world(learned.pose, d, 0.0f);
    const int3 ahead = (along > 0.0f) & 1;
    float t = hit->hidden_from;
    int3 cell = grid_cell(from + t * along, learned.inverse_radius);
    for (int step = 0; step < HIDDEN_CELL_CAP && t < t_end; step++) {
        const float3 edge = (convert_float3(cell + ahead) / learned.inverse_radius - from) / along;
        const float3 sides = select(edge, (float3)(INFINITY), isnan(edge) | isinf(edge));
        const float leave = fmin(fmin(sides.x, sides.y), fmin(sides.z, t_end));
        const int place = grid_place(cell), end = learned.start[place + 1];
        float nearest = INFINITY;
        float3 facing = (float3)(0.0f);
        for (int i = learned.start[place]; i < end; i++) {
            __global const float4 *model = learned.models + MODEL_PARTS * learned.list[i];
            const float4 centre = model[0], normal = model[1];
            const float towards = dot(normal.xyz, along);
            const float met = dot(normal.xyz, centre.xyz - from) / towards;
            if (normal.w < ASKED_FROM || !(towards < -HIDDEN_FACING)
                || !(met >= t && met <= leave && met < nearest)
                || !(model_weight(from + met * along - centre.xyz, centre.w) >= LEAST_WEIGHT)
                || !frame_hides(layer, o + met * d, to_centre(learned.pose, normal.xyz)))
                continue;
            nearest = met;
            facing = normal.xyz;
        }
        if (nearest < INFINITY) {
            float greatest;
            const float4 sum = ask_around(learned, from + nearest * along, facing, &greatest);
            if (sum.w > 0.0f) {
                hit->t = nearest;
                hit->direction = normalize(o + nearest * d);
                hit->kind = HIT_LEARNED;
#ifdef BACKGROUND
                hit->behind = 0;
#endif
                hit->learned = sum.xyz / sum.w;
                return 1;
            }
        }
        if (sides.x <= fmin(sides.y, sides.z))
            cell.x += 2 * ahead.x - 1;
        else if (sides.y <= sides.z)
            cell.y += 2 * ahead.y - 1;
        else
            cell.z += 2 * ahead.z - 1;
        t = leave;
    }
    return 0;
}

#endif
