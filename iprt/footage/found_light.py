"""Search for light from outside that no camera saw: the sun, and the sky behind windows."""

from __future__ import annotations

import numpy as np

from iprt.footage.cells import Geometry
from iprt.footage.found_sky.search import find_sky
from iprt.footage.found_sun.disc import without_disc
from iprt.footage.found_sun.irradiance import irradiance_of_sun
from iprt.footage.found_sun.search import find_direction
from iprt.footage.frame import Frame
from iprt.footage.outside_light import OutsideLight, SunChoice
from iprt.footage.received_light import OCCLUDER_ROWS, RoomLight
from iprt.footage.sun import Sun


def find_light(frame: Frame, choice: SunChoice, *, sky: bool) -> OutsideLight:
    """Return the sun that lights a frame, and the sky behind its windows.

    The sky is estimated from surfaces outside the sun's patches. The irradiance of a found sun is
    relative to all other light, the sky's included.

    Parameters
    ----------
    frame : Frame
        Sanitized, with gloss and recovered clipped lights.
    choice : SunChoice
    sky : bool
        Whether to estimate the sky.
    """
    shown = Geometry.of(frame, min(OCCLUDER_ROWS, frame.height))
    direction, correlation, doubt = None, 0.0, ""
    sun = None if choice == "auto" else choice
    if choice == "auto":
        direction, correlation, doubt = find_direction(frame, shown)
    elif choice is not None:
        direction = choice.seen_from(frame.pose)
    if direction is not None:
        frame = without_disc(frame, direction)
    room = RoomLight.of(frame, shown)
    above = find_sky(frame, room, direction) if sky else None
    if choice == "auto" and direction is not None:
        irradiance = irradiance_of_sun(frame.recolored(sky=above), room, direction)
        if irradiance is None:
            doubt = "its patches have too few borders on one surface to tell its irradiance"
        else:
            turn = np.eye(3) if frame.pose is None else frame.pose[:3, :3]
            sun = Sun(turn @ direction, irradiance, correlation=correlation)
    return OutsideLight(sun, above, doubt)
