"""A hand-held RGB-D sequence on disk: pictures, depth, poses and the camera."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from iprt.errors import FormatError, SceneError
from iprt.files.images import read_color, read_depth, read_header
from iprt.files.path_safety import stays_inside
from iprt.files.problems import describe, problems_error
from iprt.files.table import FARTHEST, Factor, FramePath, RelativePath, Table
from iprt.files.toml_text import parse_toml, printable, read_text
from iprt.files.untrusted import is_file, read_bytes
from iprt.footage.video.poses import read_poses
from iprt.footage.video.sequence import frame_path

CAMERA = "camera.toml"
SAME_TIME_S = 0.02
"""Pictures and poses further apart in time do not belong together."""
TUM_STEP_M = 1.0 / 5000.0
"""Metres of one step of 16-bit depth in TUM's sequences."""
NEARLY_WHITE = 0.95
"""Share of the range of 8 or 16 bits from where on colours may be clipped."""
UNIT = 1e-2
"""How far the length of a quaternion may be from 1."""

Matrix = NDArray[np.float64]
Axis = Literal["x", "-x", "y", "-y", "z", "-z"]


class CameraTable(Table):
    """`camera.toml`: a pinhole, and where pictures lie that no TUM lists name.

    `fx`, `fy` and `cx`, `cy` are in pixels; the centre of the first pixel is at (0, 0), as in
    OpenCV. `up` is the axis of the poses' world that points up.
    """

    fx: Factor
    fy: Factor
    cx: float = Field(ge=-FARTHEST, le=FARTHEST)
    cy: float = Field(ge=-FARTHEST, le=FARTHEST)
    depth_scale: Factor | None = None
    up: Axis = "z"
    color: FramePath | None = None
    depth: FramePath | None = None
    poses: RelativePath | None = None


@dataclass(frozen=True)
class Shot:
    """Files of one frame, and the rigid transform (4, 4) from the camera to the poses' world.

    The camera's axes are OpenCV's: +X right, +Y down, +Z ahead.
    """

    color: Path
    depth: Path
    pose: Matrix


@dataclass(frozen=True)
class Picture:
    """One frame, read.

    Attributes
    ----------
    color : (H, W, 3) float32
        Linear radiance, finite, not negative.
    depth : (H, W) float32
        Metres along the camera's +Z, 0 where there is none.
    clipped : (H, W) bool
        May be brighter than its colour.
    """

    color: NDArray[np.float32]
    depth: NDArray[np.float32]
    clipped: NDArray[np.bool_]


@dataclass(frozen=True)
class RgbdSequence:
    """The frames of a folder, in their order.

    Attributes
    ----------
    camera : CameraTable
    shots : tuple of Shot
        At least one.
    """

    camera: CameraTable
    shots: tuple[Shot, ...]

    @classmethod
    def open(cls, folder: Path) -> RgbdSequence:
        """Read `camera.toml`, the lists and the poses.

        Raises
        ------
        FormatError, SceneError
            One of them is missing or damaged, or no frames are left.
        """
        if not folder.is_dir():
            raise FormatError(f"{folder}: no such folder")
        camera = _camera(folder / CAMERA)
        shots = _tum_shots(folder) if camera.color is None else _numbered_shots(folder, camera)
        return cls(camera, shots)

    @cached_property
    def world_from_poses(self) -> Matrix:
        """(3, 3) rotation of the poses' world to +Y up."""
        return _upright(self.camera.up)

    def positions(self) -> Matrix:
        """(N, 3) camera positions, +Y up."""
        return np.stack([shot.pose[:3, 3] for shot in self.shots]) @ self.world_from_poses.T

    def pose(self, index: int, center: Matrix) -> Matrix:
        """(4, 4) transform from the camera's axes to the scene's: +Y up, origin at `center`."""
        pose = np.eye(4)
        pose[:3] = self.world_from_poses @ self.shots[index].pose[:3]
        pose[:3, 3] -= center
        return pose

    def read(self, index: int) -> Picture:
        """Colour and depth of one frame.

        Raises
        ------
        FormatError
            A file is missing or damaged, or the two differ in size.
        """
        shot = self.shots[index]
        color = read_color(shot.color)
        depth, bits = read_depth(shot.depth)
        if bits == 8:
            raise FormatError(f"{shot.depth}: depth of 8 bits; expected 16 bits, or floats")
        if color.shape[:2] != depth.shape:
            raise FormatError(
                f"{shot.depth}: {depth.shape[1]}x{depth.shape[0]} pixels, but its colour has "
                f"{color.shape[1]}x{color.shape[0]}; register depth to colour"
            )
        scale = self.camera.depth_scale or (TUM_STEP_M if bits else 1.0)
        there = np.isfinite(depth) & (depth > 0.0) & np.isfinite(color).all(axis=-1)
        limited = read_header(shot.color).has_end
        clipped = (color.max(axis=-1) >= NEARLY_WHITE) & limited
        color = np.maximum(np.nan_to_num(color, posinf=0.0, neginf=0.0), 0.0)
        metres = np.where(there, depth, 0.0) * scale
        return Picture(color, metres.astype(np.float32), clipped)


def _camera(path: Path) -> CameraTable:
    if not is_file(path):
        raise FormatError(
            f"{path}: no such file; write one with fx, fy, cx, cy in pixels (docs/capture.md)"
        )
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
    return camera


def _numbered_shots(folder: Path, camera: CameraTable) -> tuple[Shot, ...]:
    """Pictures from the lowest number of colour on, each with a line of the pose file."""
    color, depth = str(camera.color), str(camera.depth)
    first = next((n for n in range(2) if is_file(frame_path(folder, color, n))), None)
    if first is None:
        raise FormatError(f"{folder / color}: no picture with number 0 or 1")
    count = 1
    if frame_path(folder, color, 0) != frame_path(folder, color, 1):
        while is_file(frame_path(folder, color, first + count)):
            count += 1
    poses = read_poses(folder / str(camera.poses), count)
    return tuple(
        Shot(frame_path(folder, color, number), frame_path(folder, depth, number), pose)
        for number, pose in enumerate(poses, first)
    )


def _tum_shots(folder: Path) -> tuple[Shot, ...]:
    """Colour with the depth and the pose nearest in time; without either, it is left out."""
    color_at, colors = _listed(folder / "rgb.txt", 1)
    depth_at, depths = _listed(folder / "depth.txt", 1)
    pose_at, poses = _listed(folder / "groundtruth.txt", 7)
    matrices = [_tum_pose(folder / "groundtruth.txt", words) for words in poses]
    shots = []
    for time, (name,) in zip(color_at, colors, strict=True):
        depth, pose = _nearest(depth_at, time), _nearest(pose_at, time)
        if depth is not None and pose is not None:
            shots.append(Shot(folder / name, folder / depths[depth][0], matrices[pose]))
    if not shots:
        raise FormatError(
            f"{folder}: no picture of rgb.txt has a depth and a pose within {SAME_TIME_S:g} s"
        )
    return tuple(shots)


def _listed(path: Path, count: int) -> tuple[Matrix, list[list[str]]]:
    """Timestamps, ascending, and the `count` words behind each."""
    rows: list[tuple[float, list[str]]] = []
    for number, line in enumerate(read_bytes(path).decode("utf-8", "replace").splitlines(), 1):
        text = line.partition("#")[0].strip()
        if not text:
            continue
        time, *words = text.replace(",", " ").split()
        try:
            stamp = float(time)
            if not np.isfinite(stamp) or len(words) != count:
                raise ValueError
        except ValueError:
            raise FormatError(
                f"{path}: line {number}: expected a time in seconds and {count} more"
            ) from None
        if count == 1 and not stays_inside(words[0]):
            raise FormatError(f"{path}: line {number}: '{printable(words[0])}' leaves the folder")
        rows.append((stamp, words))
    if not rows:
        raise FormatError(f"{path}: lists nothing")
    rows.sort(key=lambda row: row[0])
    return np.array([row[0] for row in rows]), [row[1] for row in rows]


def _nearest(times: Matrix, time: float) -> int | None:
    """Index of the time nearest to another one; None if they are too far apart."""
    after = int(np.searchsorted(times, time))
    beside = range(max(after - 1, 0), min(after + 1, len(times)))
    best = min(beside, key=lambda index: abs(times[index] - time))
    return best if abs(times[best] - time) <= SAME_TIME_S else None


def _tum_pose(path: Path, words: list[str]) -> Matrix:
    """`tx ty tz qx qy qz qw` as (4, 4)."""
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        raise FormatError(f"{path}: '{printable(' '.join(words))}' is no pose") from None
    length = np.linalg.norm(values[3:])
    if not (np.abs(values) <= FARTHEST).all() or abs(length - 1.0) > UNIT:
        raise FormatError(
            f"{path}: '{printable(' '.join(words))}': expected tx ty tz and a unit quaternion"
        )
    x, y, z, w = values[3:] / length
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = values[:3]
    return pose


def _upright(up: Axis) -> Matrix:
    """(3, 3) rotation that takes an axis to +Y by the shortest way."""
    axis = np.zeros(3)
    axis["xyz".index(up[-1])] = -1.0 if up.startswith("-") else 1.0
    if up[-1] == "y":
        return np.diag([1.0, axis[1], axis[1]])
    # Columns of the inverse: what becomes +X, +Y and +Z.
    x = np.array([0.0, -axis[0], 0.0]) if up[-1] == "x" else np.array([1.0, 0.0, 0.0])
    return np.stack([x, axis, np.cross(x, axis)])
