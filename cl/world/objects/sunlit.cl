// Objects that the sun of lib/world/real/sun.h may reach: rays from points in their boxes leave the room. Rays of
// other objects are not aimed at the sun.
//
// in   real     lib/world/real/real.h
//      boxes    lib/world/boxes.h
// out  sunlit   per object: 1; initially 0
#include "maths/kernel_attributes.h"
#include "maths/sampling.h"
#include "world/real/sun.h"
#include "world/real/real.h"

// Work items per object, and points of each. A shaft of light through 1% of a box is missed once in 170 times.
#define PARTS 16
#define POINTS 32

TRACING_KERNEL void find_sunlit(
    const RealLayer real,
    __global const float4 *restrict boxes,
    const int objects,
    __global int *restrict sunlit,
    const Work work)
{
    const int object = get_global_id(0) / PARTS, part = get_global_id(0) % PARTS;
    if (object >= objects)
        return;
    const float3 low = boxes[2 * object].xyz, size = boxes[2 * object + 1].xyz - low;
    for (int i = 0; i < POINTS; i++) {
        const int point = POINTS * part + i;
        const float3 u = (float3)(sobol_2d(point, 0x73756eu), sobol_1d(point, 0x6c6974u));
        const RealHit hit = trace_real_layer(real, low + u * size, real.sun.disc.xyz, INFINITY);
        if (leaves_room(real, hit)) {
            sunlit[object] = 1;
            return;
        }
    }
}
