// Exact hierarchical march of a ray through an equirect image. Included once per kind of layer, with these
// macros defined by the includer:
//   MARCH_NAME                            name of the function
//   MARCH_LAYER                           type of the layer, with a member `grid`
//   MARCH_STATE                           type of the state carried from cell to cell
//   MARCH_HIT                             type of the hit
//   MARCH_WORK                            counter of its rays (lib/maths/work_counters.h)
//   MARCH_SKIP(state, near, far, range, cell)   nonzero if a ray that spans the radii [near, far]
//                                         may skip a cell of the pyramid with depths in `range`;
//                                         may update the state
//   MARCH_LEAF(layer, ray, segment, &state, hit)   nonzero if the ray hits in this texel
//
// The function returns 1 on a hit, 0 when the ray leaves [t_min, t_max] without one, and -1 when it reaches
// the step cap.
//
// Cells have integer coordinates. A descent takes the child next to the edge just crossed (the other axis
// by sign tests). An ascent happens only when the parent changes.

static inline ALWAYS_INLINE int MARCH_NAME(
    const MARCH_LAYER layer, const PolarRay ray, float t_min, float t_max, MARCH_STATE state,
    MARCH_HIT *hit)
{
    const int width = layer.grid.width, height = layer.grid.height;
    const int top = layer.grid.levels - 1;
    const float a2 = ray.m.y * ray.m.y + ray.d.y * ray.d.y;
    const int east = ray.m.x * ray.d.z - ray.m.z * ray.d.x >= 0.0f;
    const float u_end = polar_u(ray, t_max);

    Segment at;
    at.u0 = polar_u(ray, t_min);
    at.root0 = sqrt(1.0f + at.u0 * at.u0);
    at.entry = ENTRY_START;
    // A little ahead: a start on the polar axis has the azimuth of its direction.
    float2 uv = equirect_uv(ray.m + (at.u0 + 1e-6f * at.root0) * ray.d);
    at.column = clamp((int)(uv.x * layer.grid.size.x), 0, width - 1);
    at.row = clamp((int)(uv.y * layer.grid.size.y), 0, height - 1);

    int level = 0;
    int offset = 0;   // of this level in grid.range
    for (int step = 0; step < MARCH_STEP_CAP; step++) {
        const int columns = cells_along(width, level), rows = cells_along(height, level);
        const float climb = ray.d.y - at.u0 * ray.m.y;
        const int east_edge = min((at.column + 1) << level, width);
        const float side = meridian_crossing(
            ray, layer.grid.column[east ? east_edge : at.column << level], east ? 1.0f : -1.0f, at.u0);
        float over = INFINITY, under = INFINITY;
        if (climb > 0.0f || ray.m.y < 0.0f)
            over = cone_crossing(ray, a2, layer.grid.row[at.row << level], 1.0f, at.u0);
        if (climb < 0.0f || ray.m.y > 0.0f)
            under = cone_crossing(ray, a2, layer.grid.row[min((at.row + 1) << level, height)],
                                  -1.0f, at.u0);
        const float polar = smaller(over, under);
        at.u1 = smaller(smaller(side, polar), u_end);
        at.root1 = sqrt(1.0f + at.u1 * at.u1);

        const float r0 = ray.b * at.root0, r1 = ray.b * at.root1;
        const float near = at.u0 < 0.0f && at.u1 > 0.0f ? ray.b : smaller(r0, r1);
        const int cell = offset + at.row * columns + at.column;
        const float2 range = layer.grid.range[cell];
        if (!MARCH_SKIP(state, near, larger(r0, r1), range, cell)) {
            if (level > 0) {
                level--;
                const int child_columns = cells_along(width, level);
                const int child_rows = cells_along(height, level);
                const float3 w = ray.m + at.u0 * ray.d;
                int right, lower;
                if (at.entry == ENTRY_WEST || at.entry == ENTRY_EAST) {
                    right = at.entry == ENTRY_EAST;
                } else {
                    const float2 edge = layer.grid.column[min((2 * at.column + 1) << level, width)];
                    right = edge.x * w.x + edge.y * w.z > 0.0f;
                }
                if (at.entry == ENTRY_NORTH || at.entry == ENTRY_SOUTH)
                    lower = at.entry == ENTRY_SOUTH;
                else
                    lower = w.y < layer.grid.row[min((2 * at.row + 1) << level, height)] * at.root0;
                at.column = min(2 * at.column + right, child_columns - 1);
                at.row = min(2 * at.row + lower, child_rows - 1);
                offset -= child_columns * child_rows;
                continue;
            }
            if (MARCH_LEAF(layer, ray, at, &state, hit)) {
                COUNT_STEPS(layer.grid.work, MARCH_WORK, step + 1);
                return 1;
            }
        }
        if (at.u1 >= u_end) {
            COUNT_STEPS(layer.grid.work, MARCH_WORK, step + 1);
            return MARCH_END(state);
        }

        at.u0 = at.u1;
        at.root0 = at.root1;
        const int column = at.column, row = at.row;
        if (side <= polar) {
            at.entry = east ? ENTRY_WEST : ENTRY_EAST;
            at.column += east ? 1 : -1;
            if (at.column >= columns)
                at.column = 0;
            if (at.column < 0)
                at.column = columns - 1;
        } else {
            at.entry = over < under ? ENTRY_SOUTH : ENTRY_NORTH;
            at.row = clamp(at.row + (over < under ? -1 : 1), 0, rows - 1);
        }
        if (level < top && (column >> 1 != at.column >> 1 || row >> 1 != at.row >> 1)) {
            offset += columns * rows;
            level++;
            at.column >>= 1;
            at.row >>= 1;
        }
    }
    COUNT_STEPS(layer.grid.work, MARCH_WORK, MARCH_STEP_CAP);
    return -1;
}

#undef MARCH_NAME
#undef MARCH_LAYER
#undef MARCH_STATE
#undef MARCH_HIT
#undef MARCH_WORK
#undef MARCH_SKIP
#undef MARCH_LEAF
#undef MARCH_END
