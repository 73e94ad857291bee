// One level of a min/max pyramid over an image of radial distances: a cell holds the smallest minimum and
// the largest maximum of its (up to four) children. Empty texels are (INFINITY, -INFINITY) in object layers
// and (INFINITY, INFINITY) in open sky.
//
// in, out  range  all levels, finest first; level l has ceil(W/2^l) x ceil(H/2^l) cells
__kernel void reduce_range(
    const int columns,                   // of the finer level
    const int rows,
    const int fine,                      // first cell of the finer level in range
    const int coarse,                    // first cell of the coarser level
    const int first,                     // row of the coarser level
    const int count,                     // rows
    __global float2 *restrict range)     // in, out
{
    const int x = get_global_id(0), y = first + get_global_id(1);
    const int coarse_columns = (columns + 1) / 2;
    if (x >= coarse_columns || y >= min(first + count, (rows + 1) / 2))
        return;
    const int x1 = min(2 * x + 1, columns - 1), y1 = min(2 * y + 1, rows - 1);
    const float2 a = range[fine + 2 * y * columns + 2 * x];
    const float2 b = range[fine + 2 * y * columns + x1];
    const float2 c = range[fine + y1 * columns + 2 * x];
    const float2 d = range[fine + y1 * columns + x1];
    range[coarse + y * coarse_columns + x] = (float2)(
        fmin(fmin(a.x, b.x), fmin(c.x, d.x)), fmax(fmax(a.y, b.y), fmax(c.y, d.y)));
}
