"""Camera poses of a video: `poses` in `[video]`.

The file has one line per frame, with the 16 numbers of a 4x4 matrix in row-major order. It
transforms points from the frame's axes to the world (metres). Blank lines and comments after # are
ignored.
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


def read_poses(path: Path, frames: int) -> NDArray[np.float64]:
    """Read (frames, 4, 4) rigid transforms, world from capture.

    Raises
    ------
    FormatError
        All problems with the file, one per line, each with its line number.
    """
    data = read_bytes(path, frames * LONGEST_LINE + HEADER_BYTES)
    problems: list[str] = []
    rows: list[list[float]] = []
    for number, line in enumerate(data.split(b"\n"), 1):
        text = line.partition(b"#")[0].strip()
        if not text or len(problems) >= MAX_PROBLEMS:
            continue
        try:
            rows.append(_pose(text.decode("ascii", "backslashreplace")))
        except ValueError as error:
            problems.append(f"{path}: line {number}: {error}")
            rows.append([])
    if len(rows) != frames and len(problems) < MAX_PROBLEMS:
        problems.append(
            f"{path}: {counted(len(rows), 'pose')}, but the video has {counted(frames, 'frame')}; "
            "each needs a line"
        )
    if problems:
        raise FormatError("\n".join(map(printable, problems)), several_lines=True)
    poses = np.array(rows, np.float64).reshape(frames, 4, 4)
    # Take the polar factor by SVD, the nearest rotation, so that an inverse is a transpose.
    u, _, v = np.linalg.svd(poses[:, :3, :3])
    poses[:, :3, :3] = u @ v
    return poses


def _pose(text: str) -> list[float]:
    words = text.split(maxsplit=16)
    if len(words) != 16:
        found = "more" if len(words) > 16 else str(len(words))
        raise ValueError(f"expected 16 numbers, found {found}")
    values = []
    for word in words:
        try:
            value = float(word)
        except ValueError:
            raise ValueError(f"'{printable(word, 40)}' is not a number") from None
        if not abs(value) <= FARTHEST:
            raise ValueError(f"{value:g}: at most {FARTHEST:g} (metres) is allowed")
        values.append(value)
    if values[12:] != [0.0, 0.0, 0.0, 1.0]:
        raise ValueError("the last four must be 0 0 0 1 (row-major, column vectors)")
    turn = np.reshape(values, (4, 4))[:3, :3]
    if np.abs(turn.T @ turn - np.eye(3)).max() > RIGID:
        raise ValueError("scales or shears: a pose is a rotation and a translation")
    if np.linalg.det(turn) < 0.0:
        raise ValueError("mirrors: a pose is a rotation and a translation")
    return values
