"""Footage: decoding of 360° RGBD videos, and preparation of their frames."""
