"""Geometry: cameras, meshes, materials and animation."""
