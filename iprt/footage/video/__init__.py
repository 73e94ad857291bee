"""Decoding of 360° videos: tracks of color, depth and normals, from files or streams."""
