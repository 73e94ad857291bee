"""Camera poses in text: `poses` in `[video]`, and the files of `iprt.capture`.

The file of a video has one line per frame, with the 16 numbers of a 4x4 matrix in row-major order.
It transforms points from the frame's axes to the world (metres). Blank lines and comments after #
are ignored.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.message_text import counted, printable
from iprt.files.safe_reading import read_bytes
from iprt.files.toml_tables import FARTHEST, MAX_PROBLEMS

RIGID = 2e-3
"""Tolerance of the products of a rotation's columns, which allows for rounded numbers."""
LONGEST_LINE = 1024
"""Largest number of bytes in a line, with comments."""
HEADER_BYTES = 2**16
"""Additional bytes for lines of comments."""
MOST_BYTES = 2**26
"""Largest text that is read otherwise: room for poses of 250 000 frames."""

Matrix = NDArray[np.float64]


def read_poses(path: Path, frames: int) -> Matrix:
    """Read (frames, 4, 4) rigid transforms, world from capture.

    Raises
    ------
    FormatError
        All problems with the file, one per line, each with its line number.
    """
    poses, problems = [], []
    lines = read_lines(path, frames * LONGEST_LINE + HEADER_BYTES)
    for where, words in lines:
        try:
            poses.append(rigid(where, numbers(where, words)))
        except FormatError as error:
            problems.append(str(error))
    if len(lines) != frames:
        problems.append(
            f"{path}: {counted(len(lines), 'pose')}, but the video has {counted(frames, 'frame')}; "
            "each needs a line"
        )
    if problems:
        raise FormatError("\n".join(problems[:MAX_PROBLEMS]), several_lines=True)
    return np.array(poses)


def read_lines(path: Path, most_bytes: int = MOST_BYTES) -> list[tuple[str, list[str]]]:
    """Return the place and the words of each line, without comments and blank lines.

    Raises
    ------
    FormatError
        The file is missing, larger than `most_bytes`, or not a text.
    """
    data = read_bytes(path, most_bytes)
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


def rigid(where: str, values: list[float]) -> Matrix:
    """Return 16 numbers, row-major, as the nearest rigid transform (4, 4).

    Raises
    ------
    FormatError
        The count of numbers is wrong, or the matrix is not finite, scales, shears or mirrors.
    """
    if len(values) != 16:
        raise FormatError(f"{where}: expected 16 numbers, found {len(values)}")
    for value in values:
        if not abs(value) <= FARTHEST:
            raise FormatError(f"{where}: {value:g}: at most {FARTHEST:g} (metres) is allowed")
    pose = np.reshape(values, (4, 4))
    if np.abs(pose[3] - [0.0, 0.0, 0.0, 1.0]).max() > 1e-6:
        raise FormatError(f"{where}: the last four must be 0 0 0 1 (row-major, column vectors)")
    turn = pose[:3, :3]
    if np.abs(turn.T @ turn - np.eye(3)).max() > RIGID:
        raise FormatError(f"{where}: scales or shears: a pose is a rotation and a translation")
    if np.linalg.det(turn) < 0.0:
        raise FormatError(f"{where}: mirrors: a pose is a rotation and a translation")
    # Take the polar factor by SVD, the nearest rotation, so that an inverse is a transpose.
    u, _, v = np.linalg.svd(turn)
    pose[:3, :3] = u @ v
    pose[3] = 0.0, 0.0, 0.0, 1.0
    return pose
