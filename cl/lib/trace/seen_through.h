// Rays that leave the objects after the ray of a pixel has passed through dielectrics: planes written by
// trace/see_through.cl.
#pragma once

#define SEEN_ORIGIN 0     // x y z, metres from the capture centre
#define SEEN_DIRECTION 3  // x y z, unit
#define SEEN_DISTANCE 6   // to the surface that is seen, metres; negative: on an object; 0: not through a dielectric
#define SEEN_REFRACTED 7  // luminance of the refracted image
#define SEEN_REFLECTED 8  // of the image that the first surface reflects
#define SEEN_MIRRORED 9   // distance from the first surface to the reflected one, metres
#define SEEN_PLANES 10
