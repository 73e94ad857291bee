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
"""Least correlation of a sun in fine cells, and of one with a visible disc."""


def find_direction(frame: Frame, shown: Geometry) -> tuple[Float | None, float, str]:
    """Find the direction of the sun that lights patches of a frame.

    Parameters
    ----------
    frame : Frame
        Sanitized, with recovered clipped lights.
    shown : Geometry
        Its geometry, in `FINE_ROWS` rows if it has as many.

    Returns
    -------
    (3,) float64 or None
        None without sure evidence.
    float
        Its correlation.
    str
        Why there is none; else empty.
    """
    coarse, middle, fine = (
        min(rows, frame.height) for rows in (COARSE_ROWS, MIDDLE_ROWS, FINE_ROWS)
    )
    cells, blurred, occluders = (Cells.of(shown, rows) for rows in (coarse, middle, fine))
    if not ((occluders.opening + occluders.sky) > 0.5).any():
        return None, 0.0, "there are no windows and no open sky"
    disc = visible_disc(frame)
    if disc is None:
        likely, doubt = _likely(Receivers.of(frame, cells, blurred, COARSE_STEPS))
        if likely is None:
            return None, 0.0, doubt
        receivers = Receivers.of(frame, blurred, occluders, FINE_STEPS)
        direction, correlation = _refined(receivers, likely[None], FINE_ROUNDS)
        least = MIN_CORRELATION
    else:
        receivers = Receivers.of(frame, blurred, occluders, FINE_STEPS)
        direction, correlation = disc, float(receivers.correlations(disc[None])[0])
        least = MIN_OF_DISC
    if correlation < least:
        return None, correlation, _too_little(correlation, least)
    return direction, correlation, ""


def _too_little(correlation: float, least: float) -> str:
    return f"its light correlates with the picture by {correlation:.2f}, of {least:g} at least"


def _likely(receivers: Receivers) -> tuple[Float | None, str]:
    """Return the direction (3,) that explains the picture best; None and the reason without one."""
    tried = upper_hemisphere(DIRECTIONS)
    found = receivers.correlations(tried)
    best = float(found.max())
    other = float(found[tried @ tried[found.argmax()] < np.cos(APART)].max(initial=0.0))
    if best < LIKELY:
        return None, _too_little(best, LIKELY)
    if best < MIN_LEAD * other:
        return (
            None,
            f"two directions fit alike, with correlations of {best:.2f} and {other:.2f}",
        )
    return _refined(receivers, tried[np.argsort(found)[-3:]], COARSE_ROUNDS)[0], ""


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
