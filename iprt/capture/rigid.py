"""Rigid transforms, read from poses in text."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.message_text import printable
from iprt.files.safe_reading import read_bytes
from iprt.files.toml_tables import FARTHEST

RIGID = 2e-3
"""Tolerance for products of a rotation's columns, whose numbers are rounded."""
UNIT = 1e-2
"""Tolerance for the length of a unit quaternion."""
MOST_BYTES = 2**26
"""Largest text that is read: room for poses of 250 000 frames."""

Matrix = NDArray[np.float64]
Row = tuple[str, list[float]]
"""Place of numbers in a file, for messages, and the numbers."""


def read_lines(path: Path) -> list[tuple[str, list[str]]]:
    """Return the place and the words of each line, without comments and blank lines.

    Raises
    ------
    FormatError
        The file is missing, or not a text.
    """
    data = read_bytes(path, MOST_BYTES)
    if b"\0" in data:
        raise FormatError(f"{path}: a binary file; expected a text")
    lines = []
    for number, line in enumerate(data.decode("utf-8-sig", "backslashreplace").splitlines(), 1):
        words = line.partition("#")[0].replace(",", " ").split()
        if words:
            lines.append((f"{path}: line {number}", words))
    return lines


def numbers(where: str, words: list[str]) -> list[float]:
    """Parse words as numbers, including NaN and infinity, or raise FormatError."""
    values = []
    for word in words:
        try:
            values.append(float(word))
        except ValueError:
            raise FormatError(f"{where}: '{printable(word, 40)}' is not a number") from None
    return values


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
        The count of numbers is wrong, or the matrix scales, shears or mirrors.
    """
    if len(values) not in (12, 16):
        raise FormatError(f"{where}: expected 16 numbers, found {len(values)}")
    if not np.isfinite(values).all():
        return None
    farthest = max(values, key=abs)
    if not abs(farthest) <= FARTHEST:
        raise FormatError(f"{where}: {farthest:g}: at most {FARTHEST:g} (metres) is allowed")
    if len(values) == 16 and np.abs(np.array(values[12:]) - [0.0, 0.0, 0.0, 1.0]).max() > 1e-6:
        raise FormatError(f"{where}: the last four must be 0 0 0 1 (row-major, column vectors)")
    pose = np.eye(4)
    pose[:3] = np.reshape(values[:12], (3, 4))
    turn = pose[:3, :3]
    if np.abs(turn.T @ turn - np.eye(3)).max() > RIGID:
        raise FormatError(f"{where}: scales or shears: a pose is a rotation and a translation")
    if np.linalg.det(turn) < 0.0:
        raise FormatError(f"{where}: mirrors: a pose is a rotation and a translation")
    # The polar factor, by SVD, so that an inverse is a transpose.
    u, _, v = np.linalg.svd(turn)
    pose[:3, :3] = u @ v
    return pose


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
    x, y, z, w = np.array(values[3:]) / length
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = values[:3]
    return pose
