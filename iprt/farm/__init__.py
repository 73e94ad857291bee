"""Rendering of films on many machines."""
