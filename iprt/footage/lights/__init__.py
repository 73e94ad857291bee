"""Clipped lights: grouping, shading of surfaces by them, and estimation of their gains."""
