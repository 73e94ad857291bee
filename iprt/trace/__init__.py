"""Tracing services that relighting methods share: rays, paths, cones and voxels."""
