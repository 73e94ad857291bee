// Depth buffer encoding of the radial distance: 1 at the origin, 0 (the clear value) at infinity.

uniform float depth_scale;   // metres; the distance of finest relative resolution

float encode_depth(float r) { return depth_scale / (depth_scale + r); }
float decode_depth(float z) { return depth_scale * (1.0 - z) / z; }
