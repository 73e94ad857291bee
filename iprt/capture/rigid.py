"""Rigid transforms of sequences, read from poses in text."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from iprt.errors import FormatError
from iprt.files.toml_tables import FARTHEST
from iprt.footage.video import poses
from iprt.footage.video.poses import numbers, read_lines

UNIT = 1e-2
"""Tolerance for the length of a unit quaternion."""

Matrix = NDArray[np.float64]


def read_matrix(path: Path, *shapes: tuple[int, int]) -> Matrix:
    """Read the only matrix of a text, which must have one of these shapes."""
    rows = [numbers(where, words) for where, words in read_lines(path)]
    values = [value for row in rows for value in row]
    for shape in shapes:
        if len(values) == shape[0] * shape[1]:
            return np.reshape(values, shape)
    expected = " or ".join(f"{height}x{width}" for height, width in shapes)
    raise FormatError(f"{path}: expected a matrix of {expected} numbers, found {len(values)}")


def rigid(where: str, values: list[float]) -> Matrix | None:
    """Return 12 or 16 numbers, row-major, as the nearest (4, 4) rigid transform.

    It returns None if they are not all finite: some programs write such poses after losing track.

    Raises
    ------
    FormatError
        See `iprt.footage.video.poses.rigid`.
    """
    if len(values) == 12:
        values = [*values, 0.0, 0.0, 0.0, 1.0]
    if len(values) == 16 and not np.isfinite(values).all():
        return None
    return poses.rigid(where, values)


def from_quaternion(where: str, values: list[float]) -> Matrix | None:
    """Convert `tx ty tz qx qy qz qw` to (4, 4); None if they are not all finite.

    Raises
    ------
    FormatError
        The quaternion is not of unit length, or the position is too far.
    """
    if not np.isfinite(values).all():
        return None
    length = np.linalg.norm(values[3:])
    if not (np.abs(values) <= FARTHEST).all() or abs(length - 1.0) > UNIT:
        raise FormatError(f"{where}: expected tx ty tz and a unit quaternion")
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat(values[3:]).as_matrix()
    pose[:3, 3] = values[:3]
    return pose
