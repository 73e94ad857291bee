"""Layout of the TUM RGB-D benchmark: lists of pictures and poses, joined by time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.capture.found import Found
from iprt.capture.rigid import from_quaternion
from iprt.errors import FormatError
from iprt.files.kinds import PICTURE_SUFFIXES
from iprt.files.message_text import printable
from iprt.files.safe_reading import is_file, stays_inside
from iprt.footage.video.poses import numbers, read_lines

SAME_TIME_S = 0.02
"""Largest difference in time between pictures and poses that belong together."""
STEP_M = 1.0 / 5000.0
"""Metres per step of 16-bit depth."""
TRAJECTORIES = (
    "groundtruth.txt",
    "trajectory.txt",
    "CameraTrajectory.txt",
    "KeyFrameTrajectory.txt",
    "poses.txt",
)
"""Trajectory files of the benchmark and of SLAM systems."""
FOLDERS = ("rgb", "depth")
WORDS = 8
"""Number of words: a time, a position and a quaternion."""

Matrix = NDArray[np.float64]
Rows = list[tuple[str, list[str]]]


def read_tum(folder: Path) -> Found | None:
    """Join color with the depth and the pose nearest in time.

    Without `rgb.txt` and `depth.txt`, the files of `rgb` and `depth` are named by their times. It
    returns None if the folder has no lists and no such trajectory.

    Raises
    ------
    FormatError
        A list or the trajectory is damaged, or no frame is complete.
    """
    named = [name for name in TRAJECTORIES if is_file(folder / name)]
    trajectory = folder / (named[0] if named else TRAJECTORIES[0])
    listed = any(is_file(folder / f"{name}.txt") for name in FOLDERS)
    if not listed:
        rows = read_lines(trajectory)[:1] if named else []
        timed = any(len(words) == WORDS for _, words in rows)
        if not timed or not all((folder / name).is_dir() for name in FOLDERS):
            return None
    pictures = _listed if listed else _named
    color_at, colors = pictures(folder, "rgb")
    depth_at, depths = pictures(folder, "depth")
    pose_at, rows = _timed(read_lines(trajectory), str(trajectory), WORDS - 1)
    poses = [from_quaternion(where, numbers(where, words)) for where, words in rows]
    found = Found(f"TUM RGB-D ({trajectory.name})", step_m=STEP_M, up="z")
    for time, color in zip(color_at, colors, strict=True):
        depth, pose = _nearest(depth_at, time), _nearest(pose_at, time)
        found.add(
            folder / color[1][0],
            None if depth is None else folder / depths[depth][1][0],
            None if pose is None else poses[pose],
            has_pose=pose is not None,
        )
    if not found.frames:
        raise FormatError(
            f"{folder}: no color picture has a depth and a pose within {SAME_TIME_S:g} s"
        )
    return found


def _listed(folder: Path, name: str) -> tuple[Matrix, Rows]:
    """Return ascending times and the file at each, from a list."""
    path = folder / f"{name}.txt"
    return _timed(read_lines(path), str(path), 1)


def _named(folder: Path, name: str) -> tuple[Matrix, Rows]:
    """Return ascending times and the file at each, from file names."""
    files = sorted(p for p in (folder / name).iterdir() if p.suffix.lower() in PICTURE_SUFFIXES)
    rows = [(str(file), [file.stem, f"{name}/{file.name}"]) for file in files]
    return _timed(rows, str(folder / name), 1)


def _timed(rows: Rows, source: str, count: int) -> tuple[Matrix, Rows]:
    """Return ascending times and the `count` words after each, with their line for messages."""
    timed: list[tuple[float, tuple[str, list[str]]]] = []
    for where, (time, *words) in rows:
        try:
            stamp = float(time)
            if not np.isfinite(stamp) or len(words) != count:
                raise ValueError
        except ValueError:
            raise FormatError(f"{where}: expected a time in seconds and {count} more") from None
        if count == 1 and not stays_inside(words[0]):
            raise FormatError(f"{where}: '{printable(words[0])}' leaves the folder")
        timed.append((stamp, (where, words)))
    if not timed:
        raise FormatError(f"{source}: lists nothing")
    timed.sort(key=lambda row: row[0])
    return np.array([row[0] for row in timed]), [row[1] for row in timed]


def _nearest(times: Matrix, time: float) -> int | None:
    """Return the index of the time nearest to another one; None if they are too far apart."""
    after = int(np.searchsorted(times, time))
    beside = range(max(after - 1, 0), min(after + 1, len(times)))
    best = min(beside, key=lambda index: abs(times[index] - time))
    return best if abs(times[best] - time) <= SAME_TIME_S else None
