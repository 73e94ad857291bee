// Visibility, perspective: outputs 1 + the number of the visible triangle; depth is the radial distance.
// 1/w is linear in the image, so that gl_FragCoord.w is the plane's own at the pixel centre.
#version 330
#include "view.glsl"
#include "depth.glsl"

#ifndef DEPTH_ONLY
flat in float number;
layout(location = 0) out float seen;
#endif

void main()
{
    vec2 offset = (image_point(gl_FragCoord.xy) - 0.5 * view_size) / focal_px;
    gl_FragDepth = encode_depth(sqrt(1.0 + dot(offset, offset)) / max(gl_FragCoord.w, 1e-30));
#ifndef DEPTH_ONLY
    seen = number;
#endif
}
