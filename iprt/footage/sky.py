"""Radiance of the environment behind windows, in directions that no camera saw."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.device.kernel_source import constant
from iprt.geometry.camera import View
from iprt.geometry.equirect import solid_angles

OUTSIDE_ROWS = constant("lib/world/real/panorama.h", "OUTSIDE_ROWS")
"""Rows of the environment; directions that no window shows need no more."""
ELEVATIONS_DEG = (-80, -50, -30, -15, -5, 5, 12, 20, 30, 45, 65, 85)
"""Elevations of the nodes of a sky. They are dense where windows show the horizon."""
AZIMUTHS = 12
"""Number of nodes around a circle of latitude."""
MEAN_ROWS = 64
"""Rows of factors that are averaged."""


def node_directions() -> NDArray[np.float64]:
    """Return the directions (M, 3) of the nodes of a sky, one circle of latitude after another."""
    elevation = np.deg2rad(ELEVATIONS_DEG)[:, None]
    azimuth = 2.0 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    across = np.cos(elevation)
    parts = across * np.sin(azimuth), np.sin(elevation) + 0.0 * azimuth, -across * np.cos(azimuth)
    return np.stack(parts, axis=-1).reshape(-1, 3)


def node_weights(direction: NDArray[np.floating]) -> scipy.sparse.csr_array:
    """Return weights (n, M) for the bilinear interpolation of nodes in directions (n, 3)."""
    nodes = np.array(ELEVATIONS_DEG, np.float64)
    height = np.rad2deg(np.arcsin(np.clip(direction[:, 1], -1.0, 1.0)))
    turn = np.arctan2(direction[:, 0], -direction[:, 2]) / (2.0 * np.pi) * AZIMUTHS
    row = np.clip(np.searchsorted(nodes, height) - 1, 0, len(nodes) - 2)
    up = np.clip((height - nodes[row]) / (nodes[row + 1] - nodes[row]), 0.0, 1.0)
    column = np.floor(turn).astype(np.intp)
    along = turn - column
    weights = np.stack(
        [(1 - up) * (1 - along), (1 - up) * along, up * (1 - along), up * along], axis=-1
    )
    number = np.stack(
        [
            (row + below) * AZIMUTHS + (column + beside) % AZIMUTHS
            for below in (0, 1)
            for beside in (0, 1)
        ],
        axis=-1,
    )
    first = 4 * np.arange(len(direction) + 1)
    shape = (len(direction), len(nodes) * AZIMUTHS)
    return scipy.sparse.csr_array((weights.ravel(), number.ravel(), first), shape=shape)


@dataclass(frozen=True)
class Sky:
    """Factors between true and extrapolated radiance behind windows, where no camera saw it.

    Attributes
    ----------
    gain : (M, 3) float64
        Factors at the nodes, per color.
    deviation : (3,) float64
        Standard deviation of the logarithm of `mean`.
    turn : (3, 3) float64
        Rotation from the axes of a panorama to the world's, which the nodes use.
    """

    gain: NDArray[np.float64]
    deviation: NDArray[np.float64]
    turn: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))

    def seen_from(self, pose: NDArray[np.float64] | None) -> Sky:
        """Return a sky in the world's axes for a panorama with a (4, 4) pose; None: identity."""
        return self if pose is None else replace(self, turn=pose[:3, :3])

    @cached_property
    def factors(self) -> NDArray[np.float32]:
        """Factors (OUTSIDE_ROWS, 2 OUTSIDE_ROWS, 3) of the equirect environment."""
        direction = View(2 * OUTSIDE_ROWS, OUTSIDE_ROWS, projection="equirect").directions()
        found = node_weights(direction.reshape(-1, 3) @ self.turn.T) @ self.gain
        return np.asarray(found, np.float32).reshape(direction.shape)

    @property
    def mean(self) -> NDArray[np.float64]:
        """Mean factor (3,) of the upper hemisphere, by solid angle."""
        return np.asarray(upper_weights() @ self.gain)


def upper_weights() -> NDArray[np.float64]:
    """Return the weights (M,) of nodes in the mean over the upper hemisphere."""
    rows = MEAN_ROWS // 2
    direction = View(2 * MEAN_ROWS, MEAN_ROWS, projection="equirect").directions()[:rows]
    area = np.repeat(solid_angles(2 * MEAN_ROWS, MEAN_ROWS)[:rows], 2 * MEAN_ROWS)
    return np.asarray(node_weights(direction.reshape(-1, 3)).T @ (area / area.sum()))
