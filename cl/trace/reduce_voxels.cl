// Level of a mip chain of voxels from the finer level: eight voxels are reduced to one.
//
// Along each axis, the opacities of the two voxels of a pair are composited, and the four pairs averaged.
// -D ISOTROPIC: one mean opacity for all axes instead.
//
// in       levels            voxels along x, y, z; first voxel
// in, out  opacity, light    lib/trace/voxels.h, of all levels
__kernel void reduce_voxels(
    const int level,                          // the level to fill
    __global const int4 *restrict levels,
    __global float4 *restrict opacity,
    __global float4 *restrict light)
{
    const int4 fine = levels[level - 1], coarse = levels[level];
    const int i = get_global_id(0);
    if (i >= coarse.x * coarse.y * coarse.z)
        return;
    const int3 corner =
        2 * (int3)(i % coarse.x, i / coarse.x % coarse.y, i / (coarse.x * coarse.y));
    float4 bright = (float4)(0.0f);
    float open = 0.0f;
#ifdef ISOTROPIC
    float mean = 0.0f;
#else
    // Transmittance of the four pairs along each axis, by their place across it.
    float4 along_x = (float4)(1.0f), along_y = (float4)(1.0f), along_z = (float4)(1.0f);
#endif
    #pragma unroll
    for (int child = 0; child < 8; child++) {
        const int x = child & 1, y = child >> 1 & 1, z = child >> 2;
        const int3 child_at = corner + (int3)(x, y, z), at = min(child_at, fine.xyz - 1);
        const int there = all(child_at == at);
        const int voxel = fine.w + (at.z * fine.y + at.y) * fine.x + at.x;
        const float4 blocked = there ? opacity[voxel] : (float4)(0.0f);
        open += blocked.w;
        bright += there ? light[voxel] : (float4)(0.0f);
#ifdef ISOTROPIC
        mean += blocked.x + blocked.y + blocked.z;
#else
        const int4 place = (int4)(0, 1, 2, 3);
        along_x *= place == (int4)(y + 2 * z) ? (float4)(1.0f - blocked.x) : (float4)(1.0f);
        along_y *= place == (int4)(x + 2 * z) ? (float4)(1.0f - blocked.y) : (float4)(1.0f);
        along_z *= place == (int4)(x + 2 * y) ? (float4)(1.0f - blocked.z) : (float4)(1.0f);
#endif
    }
#ifdef ISOTROPIC
    opacity[coarse.w + i] = (float4)(mean / 24.0f, mean / 24.0f, mean / 24.0f, 0.125f * open);
#else
    const float4 quarter = (float4)(0.25f);
    opacity[coarse.w + i] = (float4)(1.0f - dot(along_x, quarter), 1.0f - dot(along_y, quarter),
                                     1.0f - dot(along_z, quarter), 0.125f * open);
#endif
    light[coarse.w + i] = 0.125f * bright;
}
