"""Decoding of 360° videos: tracks of colour, depth and normals, from files or streams."""
