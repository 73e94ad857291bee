// The virtual objects as rays see them, in one of two representations with the same functions, or none:
//
//   -D OBJECTS_BVH           objects_bvh.h     triangles, exactly
//   -D DISTANT_ENVIRONMENT   objects_none.h    rays meet nothing
//   without                  objects_raster.h  layers rasterized from the capture centre
//
//   Objects                                     the block of iprt/world/objects/object_bvh.py
//   trace_objects(objects, o, d, t_max, any, &hit)
//                                               nearest surface before t_max, hit.t; 1: found. With `any`,
//                                               whichever surface is found first
//   object_point(objects, hit, o, d, cone)      the surface there: Scatterer; triangles show their textures at the
//                                               level for the ray's cone
//   object_lift(objects, distance)              offset in metres of rays from visible surfaces
#pragma once

#include <iprt.world.objects.object_bvh>

#include "world/objects/objects_bvh.h"
#include "world/objects/objects_none.h"
#include "world/objects/objects_raster.h"
