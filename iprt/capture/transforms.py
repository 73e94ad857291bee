"""Layout of `transforms.json`, as NeRF's programs and nerfstudio write it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from iprt.capture.found import Found
from iprt.capture.intrinsics import checked, read_json
from iprt.capture.pinhole import Pinhole
from iprt.capture.rigid import rigid
from iprt.errors import FormatError
from iprt.files.images import read_header
from iprt.files.kinds import PICTURE_SUFFIXES
from iprt.files.message_text import printable
from iprt.files.safe_reading import MAX_SIDE, is_file, stays_inside

NAMES = ("transforms.json", "transforms_train.json")
BENDING = ("k1", "k2", "k3", "k4", "p1", "p2")
STRAIGHT = 0.01
"""Largest distortion coefficient that is ignored; it shifts pixels by at most one or two."""


def read_transforms(folder: Path) -> Found | None:
    """Read the frames; None if the folder has no such file.

    Poses are camera to world, in OpenGL's axes. `cx` and `cy` count from the corner of the first
    pixel, not from its centre.

    Raises
    ------
    FormatError
        The file is damaged, its camera is no pinhole, or no frame is complete.
    """
    path = next((folder / name for name in NAMES if is_file(folder / name)), None)
    if path is None:
        return None
    data = read_json(path)
    entries = data.get("frames")
    if not isinstance(entries, list):
        raise FormatError(f"{path}: has no list `frames`")
    model = data.get("camera_model", "PINHOLE")
    if model not in ("PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "SIMPLE_RADIAL", "RADIAL"):
        raise FormatError(f"{path}: camera_model '{printable(str(model), 40)}' is no pinhole")
    bent = any(abs(_number(data, key, str(path), -1e6, 1e6) or 0.0) > STRAIGHT for key in BENDING)
    name = f"{path.name} (NeRF, nerfstudio{'; lens distortion is not undone' if bent else ''})"
    found = Found(name, convention="opengl", up="z")
    common: Pinhole | None = None
    for number, entry in enumerate(entries):
        where = f"{path}: frames[{number}]"
        if not isinstance(entry, dict):
            raise FormatError(f"{where}: expected an object")
        color, depth = (
            _file(folder, entry, key, where) for key in ("file_path", "depth_file_path")
        )
        pose = None
        if "transform_matrix" in entry:
            pose = rigid(f"{where}.transform_matrix", _flat(entry["transform_matrix"], where))
        camera = None
        if color is not None and depth is not None:
            own = any(key in entry for key in ("fl_x", "camera_angle_x"))
            if own or common is None:
                camera = _camera({**data, **entry}, color, where if own else str(path))
            common = common if own else camera or common
        found.add(color, depth, pose, camera or common, has_pose="transform_matrix" in entry)
    return found.complete(path)


def _file(folder: Path, entry: dict[str, Any], key: str, where: str) -> Path | None:
    """Return the file that an entry names, adding a missing suffix; None if there is none."""
    name = entry.get(key)
    if name is None:
        return None
    if not isinstance(name, str) or not stays_inside(name) or "\0" in name:
        raise FormatError(f"{where}.{key}: '{printable(str(name), 80)}' leaves the folder")
    tried = (name, *(name + suffix for suffix in PICTURE_SUFFIXES))
    return next((folder / path for path in tried if is_file(folder / path)), None)


def _flat(matrix: object, where: str) -> list[float]:
    if isinstance(matrix, list) and all(isinstance(row, list) for row in matrix):
        values = [value for row in matrix for value in row]
        if all(isinstance(v, float) or (isinstance(v, int) and abs(v) < 1e9) for v in values):
            return [float(value) for value in values]
    raise FormatError(f"{where}.transform_matrix: expected four rows of four numbers")


def _camera(data: dict[str, Any], color: Path, source: str) -> Pinhole:
    """Return the camera given by a frame's own keys and the shared ones."""
    size = read_header(color).stored_size
    width, height = (
        int(_number(data, key, source, 1.0, MAX_SIDE) or side)
        for key, side in zip("wh", size, strict=True)
    )
    fx = _number(data, "fl_x", source, 1e-3, 1e9)
    angle = _number(data, "camera_angle_x", source, 1e-3, math.pi - 1e-3)
    if fx is None and angle is not None:
        fx = 0.5 * width / math.tan(0.5 * angle)
    if fx is None:
        raise FormatError(f"{source}: has neither fl_x nor camera_angle_x")
    fy = _number(data, "fl_y", source, 1e-3, 1e9) or fx
    cx, cy = (_number(data, key, source, -1e6, 1e6) for key in ("cx", "cy"))
    center = (0.5 * width if cx is None else cx, 0.5 * height if cy is None else cy)
    return checked(source, Pinhole(fx, fy, center[0] - 0.5, center[1] - 0.5, width, height))


def _number(data: dict[str, Any], key: str, source: str, least: float, most: float) -> float | None:
    value = data.get(key)
    if value is None:
        return None
    if not isinstance(value, int | float) or not least <= value <= most:
        raise FormatError(f"{source}: {key}: expected a number from {least:g} to {most:g}")
    return float(value)
