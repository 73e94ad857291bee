"""Search for the light that windows let in from directions that no camera saw."""

from __future__ import annotations

import numpy as np

from iprt.footage.cells import Float
from iprt.footage.found_sky.estimate import estimate_gains
from iprt.footage.found_sky.shading import Shading
from iprt.footage.frame import Frame
from iprt.footage.received_light import OCCLUDER_ROWS, RoomLight
from iprt.footage.sky import Sky


def find_sky(frame: Frame, room: RoomLight, sun: Float | None) -> Sky | None:
    """Estimate the sky behind a frame's windows; None if it lights too little.

    Parameters
    ----------
    frame : Frame
        Sanitized, with gloss and recovered clipped lights, without the sun's disc.
    room : RoomLight
        Its surfaces.
    sun : (3,) float64 or None
        Direction of a sun in the axes of the frame.
    """
    if frame.height < OCCLUDER_ROWS or not frame.opening.any():
        return None
    shading = Shading.of(frame, room, sun)
    if shading is None:
        return None
    turn = np.eye(3) if frame.pose is None else frame.pose[:3, :3]
    estimate = estimate_gains(shading)
    return Sky(estimate.gain, estimate.deviation, turn)
