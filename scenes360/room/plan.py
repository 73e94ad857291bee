"""Positions in the room, in metres, and shared colors.

The sun comes through the window in the left wall and is not visible from the capture centre.
"""

from __future__ import annotations

from scenes360.materials import Bsdf
from scenes360.modelling import Solid

FLOOR, CEILING = -1.5, 1.15
RUG = FLOOR + 0.0125
LEFT, RIGHT, FRONT, BACK = -2.5, 2.5, -3.0, 2.6
WINDOW_Z, WINDOW_Y = (-2.45, 0.05), (-0.85, 0.85)
TABLE_TOP = FLOOR + 0.42
FLOOR_ALPHA, TABLE_ALPHA = 0.25, 0.2
SUN = (-0.5, 0.9, -0.25)
SEED = 360
WHITE_WALL = (0.66, 0.635, 0.59)
OAK_DARK, OAK_LIGHT = (0.34, 0.20, 0.10), (0.62, 0.42, 0.24)
WALNUT_DARK, WALNUT_LIGHT = (0.085, 0.042, 0.02), (0.20, 0.105, 0.052)
TEAK_DARK, TEAK_LIGHT = (0.26, 0.135, 0.06), (0.45, 0.26, 0.125)
BRASS = (0.80, 0.62, 0.32)
LAMP = (2.02, FLOOR, -2.52)

Pieces = list[tuple[Solid, Bsdf]]
