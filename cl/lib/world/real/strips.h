// Strips of the panorama's rows, by which pictures.cl tells where radiance has changed.
#pragma once

// Adjacent texels of a strip: a whole number of LANES.
#define STRIP 32
