// Linear maps between the colors of a video frame and of its reference frame.
#pragma once

// First rows, xyz each, of the map to the reference's colors, and of its inverse.
#define TO_REFERENCE 0
#define TO_FRAME 3

static inline float3 map_color(__global const float4 *restrict maps, int first, float3 color)
{
    return (float3)(dot(maps[first].xyz, color), dot(maps[first + 1].xyz, color),
                    dot(maps[first + 2].xyz, color));
}
