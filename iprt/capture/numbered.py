"""Layouts of numbered pictures, with poses in a list, a file each, or a trajectory log."""

from __future__ import annotations

import glob
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.capture.found import Found, by_number
from iprt.capture.rigid import read_matrix, rigid
from iprt.capture.tum import STEP_M
from iprt.errors import FormatError
from iprt.files.kinds import FRAME_PATTERN
from iprt.files.safe_reading import is_file
from iprt.footage.video.picture_tracks import frame_path
from iprt.footage.video.poses import numbers, read_lines

COLOR_FOLDERS = ("color", "rgb", "image", "images", "colour")
DEPTH_FOLDERS = ("depth", "depths", "depth_images")
POSE_FOLDERS = ("pose", "poses")
POSE_FILES = ("poses.txt", "pose.txt", "traj.txt", "trajectory.txt", "groundtruth.txt")
NUMBER = r"\D*(\d+)(?:-\d+)?"
"""Stem of a numbered file; in Redwood's, a time follows the number."""

Matrix = NDArray[np.float64]
Files = dict[int, Path]
Poses = dict[int, Matrix | None]


def read_listed(folder: Path, color: str, depth: str, poses: str) -> Found:
    """Read pictures named by printf patterns, and a pose file with a line for each number.

    Raises
    ------
    FormatError
        The pose file is damaged, or no frame is complete.
    """
    colors, depths = _matching(folder, color), _matching(folder, depth)
    if not colors or min(colors) > 1:
        raise FormatError(f"{folder / color}: no picture with number 0 or 1")
    found = Found(f"numbered pictures ({poses})", step_m=STEP_M, up="z")
    return _joined(found, folder / poses, colors, depths, _rows(folder / poses, colors))


def read_rows(folder: Path) -> Found | None:
    """Read folders of pictures, and a pose file with a line of 12 or 16 numbers for each.

    It returns None if the folder lacks any of them.
    """
    path = next((folder / name for name in POSE_FILES if is_file(folder / name)), None)
    colors, depths = _pictures(folder)
    if path is None or not colors or not depths:
        return None
    found = Found(f"numbered pictures ({path.name})")
    return _joined(found, path, colors, depths, _rows(path, colors))


def read_per_frame(folder: Path) -> Found | None:
    """Read numbered pictures with a pose file each; None if the folder has none.

    The layouts are `frame-000000.color.png`, `.depth.png` and `.pose.txt` (7-Scenes), and
    `color/0.jpg`, `depth/0.png` and `pose/0.txt` (exports of ScanNet).

    Raises
    ------
    FormatError
        A pose is damaged, or no frame is complete.
    """
    files = by_number(folder, NUMBER + r"\.pose", (".txt",))
    found = Found("7-Scenes (a pose file per frame)")
    colors, depths = (by_number(folder, NUMBER + kind) for kind in (r"\.color", r"\.depth"))
    if not files:
        files = by_number(_folder(folder, POSE_FOLDERS), NUMBER, (".txt",))
        found = Found("ScanNet export (color, depth, pose)", up="z")
        colors, depths = _pictures(folder)
    if not files:
        return None
    poses = {n: rigid(str(p), list(read_matrix(p, (4, 4), (3, 4)).flat)) for n, p in files.items()}
    return _joined(found, folder, colors, depths, poses)


def read_log(folder: Path) -> Found | None:
    """Read numbered pictures and a trajectory log of Open3D or Redwood.

    Each pose is a line of three integers and four lines of a matrix. It returns None without a log.

    Raises
    ------
    FormatError
        The log is damaged, or no frame is complete.
    """
    logs = [p for place in (folder, folder / "scene") for p in sorted(place.glob("*.log"))]
    path = min(logs, key=lambda p: p.name != "trajectory.log", default=None)
    if path is None:
        return None
    rows = read_lines(path)
    poses: Poses = {}
    for start in range(0, len(rows), 5):
        where, words = rows[start]
        if len(words) != 3 or not words[0].isdecimal():
            raise FormatError(
                f"{where}: expected three whole numbers, then a matrix on four lines, for each pose"
            )
        matrix = [value for at, line in rows[start + 1 : start + 5] for value in numbers(at, line)]
        poses[int(words[0])] = rigid(where, matrix)
    colors, depths = _pictures(folder)
    if len(poses) == len(colors) and set(poses) != set(colors):
        # Picture numbers may start at 1 or have gaps, while the log counts from 0.
        poses = dict(zip(sorted(colors), (poses[n] for n in sorted(poses)), strict=True))
    if len(colors) == len(depths) and set(colors) != set(depths):
        # In Redwood's names, a time follows the number, and differs between the two.
        depths = dict(zip(sorted(colors), (depths[n] for n in sorted(depths)), strict=True))
    return _joined(Found(f"Open3D or Redwood ({path.name})"), folder, colors, depths, poses)


def _rows(path: Path, colors: Files) -> Poses:
    """Return one pose per line, for each picture or for consecutive numbers from the first."""
    rows = read_lines(path)
    first = min(colors)
    order = sorted(colors) if len(rows) == len(colors) else range(first, first + len(rows))
    return {n: rigid(at, numbers(at, words)) for n, (at, words) in zip(order, rows, strict=True)}


def _joined(found: Found, source: Path, colors: Files, depths: Files, poses: Poses) -> Found:
    """Add the frames of all numbers; raise FormatError about `source` if none is complete."""
    for number in sorted(colors.keys() | depths.keys() | poses.keys()):
        found.add(
            colors.get(number), depths.get(number), poses.get(number), has_pose=number in poses
        )
    return found.complete(source)


def _pictures(folder: Path) -> tuple[Files, Files]:
    """Return the files of color and depth in their folders, by number."""
    color, depth = (_folder(folder, names) for names in (COLOR_FOLDERS, DEPTH_FOLDERS))
    return by_number(color, NUMBER), by_number(depth, NUMBER)


def _matching(folder: Path, pattern: str) -> Files:
    """Return files by the number in a printf pattern; a name without a pattern gets 0."""
    before, after = FRAME_PATTERN.split(pattern)[::2] if "%" in pattern else (pattern, "")
    names = re.compile(f"{re.escape(before)}([0-9]+){re.escape(after)}")
    found = {}
    for path in folder.glob(f"{glob.escape(before)}*{glob.escape(after)}"):
        name = path.relative_to(folder).as_posix()
        match = names.fullmatch(name)
        if match and frame_path(folder, pattern, int(match[1])) == path:
            found[int(match[1])] = path
        elif name == pattern:
            found[0] = path
    return found


def _folder(folder: Path, names: tuple[str, ...]) -> Path:
    """Return the first of these folders that exists, or the first name."""
    return next((folder / name for name in names if (folder / name).is_dir()), folder / names[0])
