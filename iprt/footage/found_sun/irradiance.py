"""Irradiance of a sun, from both sides of the borders of its patches."""

from __future__ import annotations

import numpy as np

from iprt.footage.cells import Float, cell_means
from iprt.footage.found_sun.patches import STEPS, border_pairs
from iprt.footage.found_sun.receivers import Receivers
from iprt.footage.frame import Frame
from iprt.footage.received_light import RoomLight
from iprt.footage.window_environment import outside_radiance


def irradiance_of_sun(
    frame: Frame, room: RoomLight, direction: Float
) -> tuple[float, float, float] | None:
    """Return the irradiance of a surface perpendicular to the sun; None with too few borders.

    On both sides of a border a surface has the same reflectance. The quotient q of its radiance in
    the sun and in the shade is (E + S cos) / E', with the irradiance E and E' of the two points by
    all other light. The median of S = (q E' - E) / cos over pairs of points is returned.

    Parameters
    ----------
    frame : Frame
        Without the sun's disc, with the sky behind windows.
    room : RoomLight
        Its surfaces.
    direction : (3,) float64
        Unit vector towards the sun.
    """
    cells = room.occluders
    pairs = border_pairs(Receivers.of(frame, cells, cells, STEPS), direction)
    if pairs is None:
        return None
    lit, shaded = pairs
    color = cell_means(frame.radiance, cells.rows).reshape(-1, 3)
    quotient = color[lit] / np.maximum(color[shaded], 1e-30)
    outside = None
    if frame.opening.any():
        seen = frame.radiance[frame.opening]
        outside = outside_radiance(seen, frame.opening, frame.sky)
    both = np.concatenate(pairs)
    light = room.received(cells.point[both], cells.normal[both])
    in_sun, in_shade = np.split(light.irradiance(outside), 2)
    cosine = cells.normal[lit] @ direction
    sun = np.median((quotient * in_shade - in_sun) / cosine[:, None], axis=0)
    red, green, blue = np.maximum(sun, 0.0).tolist()
    return (red, green, blue) if red + green + blue > 0.0 else None
