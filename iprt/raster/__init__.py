"""Rasterization of the virtual objects with OpenGL."""
