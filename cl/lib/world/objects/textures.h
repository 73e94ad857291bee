// Textures of objects, and their mip levels (iprt/world/objects/mip_levels.py), -D TEXTURES.
//
//   image    x: index of the first texel, and how the image is read beyond 0 and 1; y: width, and whether the nearest
//            texel is read; z: height. The levels follow each other, each half as wide and high, rounded down, at
//            least 1. Maps of variants, -D VARIANTS, have the finest alone.
#pragma once

// Bits of an image's first texel: its place, and from TEXTURE_WRAP on how it is read beyond 0 and 1 along u and v, two
// bits each. Bit of its width: the nearest texel is read.
#define TEXTURE_WRAP 28
#define TEXTURE_NEAREST 30
#define WRAP_CLAMP 1
#define WRAP_MIRROR 2

#ifdef TEXTURES

// Return a coordinate of a texture of `size` texels in the range of their centres.
static inline float wrapped(float u, uint wrap, float size)
{
    const float half_texel = 0.5f / size, turned = u - 2.0f * floor(0.5f * u);
    u = wrap == WRAP_MIRROR ? 1.0f - fabs(1.0f - turned) : u;
    return clamp(u, half_texel, 1.0f - half_texel);
}

// An image in the table of materials, unpacked: a level of it, and how it is read.
typedef struct {
    int first;       // index of the level's first texel
    int2 size;
    uint flags;      // bits of wrap along u and v, and NEAREST_FLAG
} TextureLevel;

#define NEAREST_FLAG 16u

static inline TextureLevel finest_level(int4 image)
{
    TextureLevel level;
    level.first = image.x & ((1 << TEXTURE_WRAP) - 1);
    level.size = (int2)(image.y & ((1 << TEXTURE_NEAREST) - 1), image.z);
    level.flags = ((uint)image.x >> TEXTURE_WRAP) | (image.y >> TEXTURE_NEAREST ? NEAREST_FLAG : 0u);
    return level;
}

static inline TextureLevel coarser_level(TextureLevel level)
{
    level.first += level.size.x * level.size.y;
    level.size = max(level.size >> 1, 1);
    return level;
}

// Return the bilinear value of a level; row 0 is at v = 1.
static inline float4 level_value(__global const half *texels, TextureLevel level, float2 uv)
{
    const int2 size = level.size;
    const uint along_u = level.flags & 3u, along_v = level.flags >> 2 & 3u;
    if (along_u)
        uv.x = wrapped(uv.x, along_u, size.x);
    if (along_v)
        uv.y = wrapped(uv.y, along_v, size.y);
    if (level.flags & NEAREST_FLAG)
        uv = (floor(uv * (float2)(size.x, size.y)) + 0.5f) / (float2)(size.x, size.y);
    const float2 at = (uv - floor(uv)) * (float2)(size.x, -size.y) - 0.5f;
    const float2 low = floor(at), part = at - low;
    int x = (int)low.x, y = (int)low.y + size.y;
    x = clamp(x < 0 ? x + size.x : x, 0, size.x - 1);
    y = clamp(y < 0 ? y + size.y : y, 0, size.y - 1);
    const int right = x + 1 < size.x ? x + 1 : 0, below = y + 1 < size.y ? y + 1 : 0;
    const int row0 = level.first + y * size.x, row1 = level.first + below * size.x;
    const float4 upper = mix(vload_half4(row0 + x, texels), vload_half4(row0 + right, texels), part.x);
    const float4 lower = mix(vload_half4(row1 + x, texels), vload_half4(row1 + right, texels), part.x);
    return mix(upper, lower, part.y);
}

// Return the number of the level, maybe between two, for a footprint in texture coordinates; 0: the finest.
static inline float level_number(int2 size, float footprint)
{
    const int last = 31 - clz(max(size.x, size.y));
    return clamp(log2(fmax(footprint * sqrt((float)size.x * (float)size.y), 1.0f)), 0.0f, (float)last);
}

// Return the trilinear value of a texture.
static inline float4 object_texture(__global const half *texels, int4 image, float2 uv, float footprint)
{
    TextureLevel level = finest_level(image);
    const float number = level_number(level.size, footprint);
    const int finer = (int)number;
    for (int i = 0; i < finer; i++)
        level = coarser_level(level);
    const float4 value = level_value(texels, level, uv);
    const float part = number - (float)finer;
    return part > 0.0f ? mix(value, level_value(texels, coarser_level(level), uv), part) : value;
}

#ifdef VARIANTS
// Return the index in a texel drawn at random: indices have no mean. The texel lies within the footprint, or as likely
// as its weight in the bilinear value where that is wider. Pictures thus have the mean of the filtered map (M.
// Fajardo, B. Wronski, M. Salvi, M. Pharr, "Stochastic Texture Filtering", 2023). u in [0, 1)^2.
static inline int drawn_index(__global const uchar *indices, int4 image, float2 uv, float footprint, float2 u)
{
    const TextureLevel map = finest_level(image);
    const float2 size = convert_float2(map.size);
    const float2 least = map.flags & NEAREST_FLAG ? (float2)(0.0f) : 1.0f / size;
    uv += (u - 0.5f) * fmax(least, (float2)(footprint));
    const uint along_u = map.flags & 3u, along_v = map.flags >> 2 & 3u;
    if (along_u)
        uv.x = wrapped(uv.x, along_u, size.x);
    if (along_v)
        uv.y = wrapped(uv.y, along_v, size.y);
    const float2 part = uv - floor(uv);
    const int x = min((int)(part.x * size.x), map.size.x - 1);
    const int y = min((int)((1.0f - part.y) * size.y), map.size.y - 1);
    return indices[map.first + y * map.size.x + x];
}
#endif

#endif
