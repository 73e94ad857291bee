"""Bounding volume hierarchies of the virtual objects, built on the host."""
