// Inverse depth of the panorama, in lines that continue beyond the seam, so that neighbours of a texel are
// found without wrapping.
//
// in   depth    [rows*W]  metres from the capture centre; INFINITY: open sky
//      marks    [rows*W]  1: an opening
//      lines    [H]       x: index of a row's column 0 in `inverse`; y, z: columns by which the line
//                         continues to the left and to the right, at most W
// out  inverse            1/m, 0 in open sky, with the sign bit of openings
//
// Launched for some rows at a time, so that the whole depth image is never on the device.

// Largest inverse depth. Products stay finite, because infinity times 0 is not 0.
#define NEAREST 1e30f

__kernel void invert_depth(
    const int width,
    const int rows,                            // in `depth` and `marks`
    const int first,                           // index of the first one
    __global const float *restrict depth,
    __global const uchar *restrict marks,
    __global const int4 *restrict lines,
    __global float *restrict inverse)          // out
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= rows)
        return;
    const int4 line = lines[first + y];
    const float f = fmin(1.0f / depth[y * width + x], NEAREST);
    const float signed_f = marks[y * width + x] ? -f : f;
    inverse[line.x + x] = signed_f;
    if (x >= width - line.y)
        inverse[line.x + x - width] = signed_f;
    if (x < line.z)
        inverse[line.x + x + width] = signed_f;
}
