"""Position, angles and size of an object, as inputs give them."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from iprt.viewer.gizmo import turn_of, turned_to
from iprt.viewer.object_states import ObjectState

Float = NDArray[np.float64]


def moved(state: ObjectState, position: ArrayLike) -> Float:
    """Return the transform (4, 4) with the pivot at a position (3,) in metres."""
    return state.about_pivot(state.to_world[:3, :3], np.array(position))


def angles_of(state: ObjectState) -> Float:
    """Return the rotations (3,) about X, Y and Z in degrees; Z is applied first, Y last."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # at ±90° about x, z is 0
        y, x, z = Rotation.from_matrix(turn_of(state)).as_euler("YXZ", degrees=True)
    return np.array([x, y, z])


def turned(state: ObjectState, angles: ArrayLike) -> Float:
    """Return the transform (4, 4) with these rotations; see `angles_of`."""
    x, y, z = np.array(angles)
    turn = Rotation.from_euler("YXZ", [y, x, z], degrees=True).as_matrix()
    return turned_to(state, turn)


def resized(state: ObjectState, size_m: float) -> Float:
    """Return the transform (4, 4) with a longest side above 0 in metres."""
    factor = size_m / float(state.size.max())
    return state.about_pivot(factor * state.to_world[:3, :3])
