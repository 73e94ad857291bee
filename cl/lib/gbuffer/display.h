// The drawn image of the objects in a view: float4 images of height * width, which visibility.cl and the OpenGL
// rasterizer write and unpack.cl reads.
//
//   0   world normal, radial distance in metres (0: no surface)
//   1   albedo, 1 + material index
//   2   coverage: fraction of the pixel in which an object is in front of the real surface; image point in the
//       previous view, pixels ((-1e9, -1e9): nowhere); fraction in which there is any object
//   3   metalness, alpha of GGX, and the normal of the clearcoat as in lib/world/finish.h, or 0, 0: only where a material
//       is principled
//   4   emitted radiance, 0: only where a material emits light
#pragma once

#define DISPLAY_NORMAL 0
#define DISPLAY_MATERIAL 1
#define DISPLAY_COVERAGE 2
#define DISPLAY_FINISH 3
#define DISPLAY_EMISSION 4
