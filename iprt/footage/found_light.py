"""Search for light from outside that no camera saw: the sun, and the sky behind windows."""

from __future__ import annotations

from typing import Literal

import numpy as np

from iprt.footage.found_sky.search import find_sky
from iprt.footage.found_sun.disc import without_disc
from iprt.footage.found_sun.irradiance import irradiance_of_sun
from iprt.footage.found_sun.search import find_direction
from iprt.footage.frame import Frame
from iprt.footage.sky import Sky
from iprt.footage.sun import Sun

SunChoice = Sun | Literal["auto"] | None
"""A known sun, "auto" to look for one, or None for none."""


def find_light(frame: Frame, choice: SunChoice, *, sky: bool) -> tuple[Sun | None, Sky | None]:
    """Return the sun that lights a frame, and the sky behind its windows.

    The sky is estimated from what the sun does not light. The irradiance of a sun that is found is
    relative to all other light, the sky's included.

    Parameters
    ----------
    frame : Frame
        Sanitized, with gloss and recovered clipped lights.
    choice : SunChoice
    sky : bool
        Whether to estimate the sky.
    """
    turn = np.eye(3) if frame.pose is None else frame.pose[:3, :3]
    correlation, sun = None, None if choice == "auto" else choice
    direction = None if sun is None else sun.seen_from(frame.pose)
    if choice == "auto" and (found := find_direction(frame)) is not None:
        direction, correlation = found
    if direction is not None:
        frame = without_disc(frame, direction)
    above = find_sky(frame, direction) if sky else None
    if correlation is not None and direction is not None:
        irradiance = irradiance_of_sun(frame.recolored(sky=above), direction)
        if irradiance is not None:
            sun = Sun(turn @ direction, irradiance, correlation=correlation)
    return sun, above
