"""Search for a sun that the panorama does not show, by the patches that it lights.

Analysis by synthesis: for each direction of the upper hemisphere, rays from the surfaces tell where
a sun there would shine. Its pattern of light is correlated with the logarithm of the radiance, both
less their local means. Windows, frames and leaves make patterns that fit one direction only. A sun
counts as found only where the correlation is high, and no other direction comes close.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from iprt.footage.cells import Cells, Float, Geometry
from iprt.footage.found_sun.disc import visible_disc
from iprt.footage.found_sun.receivers import Receivers
from iprt.footage.frame import Frame

COARSE_ROWS, MIDDLE_ROWS, FINE_ROWS = 64, 128, 256
"""Rows of cells: receivers of the search; its occluders, and receivers of its refinement; occluders
there."""
DIRECTIONS = 350
"""Directions of the upper hemisphere that are tried: one every 7.7°."""
COARSE_STEPS, FINE_STEPS = 50, 200
"""Points at which rays are tested, in the search and in its refinement."""
COARSE_ROUNDS, FINE_ROUNDS, TRIES = (6.0, 2.5), (2.0, 0.7), 16
"""Radii, in degrees, of the rounds of refinement on coarse and fine cells; directions in each."""
GOLDEN = np.pi * (1.0 + 5.0**0.5)
"""Turn between points of a Fibonacci spiral."""
APART = np.deg2rad(25.0)
"""Angle from the best direction beyond which another one is another peak."""
LIKELY, MIN_LEAD = 0.25, 1.2
"""Least correlation in coarse cells, and least quotient of it and the next other peak's."""
MIN_CORRELATION, MIN_OF_DISC = 0.33, 0.2
"""Least correlation of a sun in fine cells, and of one whose disc is in sight."""


def find_direction(frame: Frame) -> tuple[Float, float] | None:
    """Return the direction (3,) of the sun that lights patches of a frame, and its correlation.

    Returns None without sure evidence.

    Parameters
    ----------
    frame : Frame
        Sanitized, with recovered clipped lights.
    """
    coarse, middle, fine = (
        min(rows, frame.height) for rows in (COARSE_ROWS, MIDDLE_ROWS, FINE_ROWS)
    )
    shown = Geometry.of(frame, fine)
    cells, blurred, occluders = (Cells.of(shown, rows) for rows in (coarse, middle, fine))
    if not ((occluders.opening + occluders.sky) > 0.5).any():
        return None
    disc = visible_disc(frame)
    if disc is None:
        likely = _likely(Receivers.of(frame, cells, blurred, COARSE_STEPS))
        if likely is None:
            return None
        receivers = Receivers.of(frame, blurred, occluders, FINE_STEPS)
        direction, correlation = _refined(receivers, likely[None], FINE_ROUNDS)
        return (direction, correlation) if correlation >= MIN_CORRELATION else None
    receivers = Receivers.of(frame, blurred, occluders, FINE_STEPS)
    correlation = float(receivers.correlations(disc[None])[0])
    return (disc, correlation) if correlation >= MIN_OF_DISC else None


def _likely(receivers: Receivers) -> Float | None:
    """Return the direction (3,) that explains the picture best; None if another does nearly."""
    tried = upper_hemisphere(DIRECTIONS)
    found = receivers.correlations(tried)
    best = float(found.max())
    other = float(found[tried @ tried[found.argmax()] < np.cos(APART)].max(initial=0.0))
    if best < LIKELY or best < MIN_LEAD * other:
        return None
    return _refined(receivers, tried[np.argsort(found)[-3:]], COARSE_ROUNDS)[0]


def upper_hemisphere(count: int) -> Float:
    """Return directions (count, 3) spread over the upper hemisphere by a Fibonacci spiral."""
    turn = np.arange(count) + 0.5
    height = turn / count
    azimuth = turn * GOLDEN
    across = np.sqrt(1.0 - height**2)
    return np.stack([across * np.cos(azimuth), height, across * np.sin(azimuth)], axis=-1)


def _refined(receivers: Receivers, starts: Float, radii: Sequence[float]) -> tuple[Float, float]:
    """Return the best direction near some directions (K, 3), and its correlation."""
    around, value = starts, -1.0
    for radius in radii:
        tried = np.concatenate([around, *(_cone(axis, np.deg2rad(radius)) for axis in around)])
        tried = tried[tried[:, 1] > 0.0]
        found = receivers.correlations(tried)
        around, value = tried[[found.argmax()]], float(found.max())
    return around[0], value


def _cone(axis: Float, radius: float) -> Float:
    """Return directions (TRIES, 3) spread over a cone around a unit vector, by a spiral."""
    turn = np.arange(TRIES) + 0.5
    away, azimuth = radius * np.sqrt(turn / TRIES), turn * GOLDEN
    side = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    side /= np.linalg.norm(side)
    beside = np.cos(azimuth)[:, None] * side + np.sin(azimuth)[:, None] * np.cross(axis, side)
    return np.asarray(np.cos(away)[:, None] * axis + np.sin(away)[:, None] * beside)
