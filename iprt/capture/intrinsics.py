"""Cameras of a sequence, from `camera.toml` or from files of common layouts and 3D libraries."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from iprt.capture.found import Axis
from iprt.capture.pinhole import Pinhole
from iprt.capture.rigid import read_matrix
from iprt.errors import FormatError, SceneError
from iprt.files.images import picture_size, read_header
from iprt.files.message_text import printable
from iprt.files.safe_reading import is_file, read_bytes
from iprt.files.toml_tables import (
    FARTHEST,
    Factor,
    FramePath,
    RelativePath,
    Table,
    describe,
    problems_error,
)
from iprt.files.toml_text import parse_toml, read_text
from iprt.footage.video.poses import MOST_BYTES

CAMERA = "camera.toml"
MATRICES = ("intrinsic/intrinsic_color.txt", "intrinsic_color.txt", "camera-intrinsics.txt")
"""Texts with a 3x3 or 4x4 matrix, as in exports of ScanNet and in 3DMatch."""
DEPTH_MATRICES = ("intrinsic/intrinsic_depth.txt", "intrinsic_depth.txt")
JSON_FILES = ("intrinsic.json", "intrinsics.json", "camera_intrinsic.json", "camera.json")
"""Files with a column-major `intrinsic_matrix`, as Open3D writes them."""
KEYS = ("fx", "fy", "cx", "cy")
Coordinate = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]


class CameraTable(Table):
    """The table of `camera.toml`: a pinhole, and the pictures' paths without a known layout.

    `fx`, `fy` and `cx`, `cy` are in pixels of color; the centre of the first pixel is at (0, 0),
    as in OpenCV. Layouts with their own intrinsics may omit them. `up` is the axis of the poses'
    world that points up.
    """

    fx: Factor | None = None
    fy: Factor | None = None
    cx: Coordinate | None = None
    cy: Coordinate | None = None
    depth_scale: Factor | None = None
    up: Axis | None = None
    color: FramePath | None = None
    depth: FramePath | None = None
    poses: RelativePath | None = None


def read_camera_table(path: Path) -> CameraTable:
    """Read `camera.toml`; the table is empty without the file.

    Raises
    ------
    SceneError
        The file is damaged, or has only a part of the pinhole or of the patterns.
    """
    if not is_file(path):
        return CameraTable()
    data: dict[str, Any] = {}
    try:
        data = parse_toml(read_text(path))
        camera = CameraTable.model_validate(data)
    except ValidationError as error:
        problems = [describe(fault, data, CameraTable) for fault in error.errors()]
        raise problems_error(str(path), problems) from None
    except (OSError, ValueError) as error:
        raise SceneError(f"{path}: {printable(str(error))}") from None
    named = [key for key in ("color", "depth", "poses") if getattr(camera, key) is not None]
    if len(named) not in (0, 3):
        raise SceneError(f"{path}: has {' and '.join(named)}; give color, depth and poses, or none")
    missing = [key for key in KEYS if getattr(camera, key) is None]
    if len(missing) not in (0, len(KEYS)):
        raise SceneError(f"{path}: has no {' and '.join(missing)}; give {', '.join(KEYS)}, or none")
    return camera


def camera_of_table(table: CameraTable, color: Path) -> Pinhole | None:
    """Return the pinhole of a `camera.toml`, for pictures of the size of `color`."""
    if table.fx is None or table.fy is None or table.cx is None or table.cy is None:
        return None
    return Pinhole(table.fx, table.fy, table.cx, table.cy, *read_header(color).stored_size)


def cameras_of_files(
    folder: Path, color: Path, depth: Path
) -> tuple[Pinhole | None, Pinhole | None]:
    """Return the cameras of color and depth from files in the folder; None where missing.

    Raises
    ------
    FormatError
        A file, or a picture whose size is needed, is damaged.
    """
    matrix, source = _matrix(folder, MATRICES), folder
    if matrix is None:
        source = next((folder / name for name in JSON_FILES if is_file(folder / name)), folder)
        if source != folder:
            return _open3d(source), None
        return None, None
    depth_matrix = _matrix(folder, DEPTH_MATRICES)
    return (
        _pinhole(folder, matrix, *read_header(color).stored_size),
        None if depth_matrix is None else _pinhole(folder, depth_matrix, *picture_size(depth)),
    )


def read_json(path: Path) -> dict[str, Any]:
    """Read the object in a JSON file.

    Raises
    ------
    FormatError
        The file is not JSON, or holds no object.
    """
    try:
        data = json.loads(read_bytes(path, MOST_BYTES))
    except (ValueError, RecursionError) as error:
        reason = printable(str(error)) if isinstance(error, json.JSONDecodeError) else "not a text"
        raise FormatError(f"{path}: not valid JSON ({reason})") from None
    if not isinstance(data, dict):
        raise FormatError(f"{path}: expected a JSON object")
    return data


def _open3d(path: Path) -> Pinhole:
    data = read_json(path)
    try:
        # Column-major.
        matrix = np.reshape(np.array(data["intrinsic_matrix"], np.float64), (3, 3)).T
        width, height = int(data["width"]), int(data["height"])
    except (KeyError, TypeError, ValueError, OverflowError):
        raise FormatError(
            f"{path}: expected width, height and 9 numbers of intrinsic_matrix, as Open3D has them"
        ) from None
    return _pinhole(path, matrix, width, height)


def _matrix(folder: Path, names: tuple[str, ...]) -> NDArray[np.float64] | None:
    path = next((folder / name for name in names if is_file(folder / name)), None)
    return None if path is None else read_matrix(path, (3, 3), (4, 4))


def _pinhole(source: Path, matrix: NDArray[np.float64], width: int, height: int) -> Pinhole:
    fx, fy, cx, cy = (float(matrix[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
    return checked(str(source), Pinhole(fx, fy, cx, cy, width, height))


def checked(source: str, camera: Pinhole) -> Pinhole:
    """Return a camera after checking its intrinsics; `source` names it in errors."""
    size = f"{camera.width}x{camera.height}"
    if not (camera.fx > 0.0 and camera.fy > 0.0):
        raise FormatError(f"{source}: focal lengths of {camera.fx:g} and {camera.fy:g} pixels")
    if not (-1 < camera.cx < camera.width and -1 < camera.cy < camera.height):
        raise FormatError(
            f"{source}: the principal point ({camera.cx:g}, {camera.cy:g}) lies outside of "
            f"pictures of {size}; are the intrinsics of another size?"
        )
    return camera
