"""A hand-held RGB-D sequence on disk: pictures, depth, poses and the camera."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.capture.conventions import WORDS, Settled, sample, settle, up_axis, world_from_camera
from iprt.capture.found import Axis, Convention, Found
from iprt.capture.intrinsics import (
    CAMERA,
    CameraTable,
    camera_of_table,
    cameras_of_files,
    read_camera_table,
)
from iprt.capture.numbered import read_listed, read_log, read_per_frame, read_rows
from iprt.capture.overlap import Glance
from iprt.capture.pinhole import Pinhole, blocks, sampled
from iprt.capture.transforms import read_transforms
from iprt.capture.tum import read_tum
from iprt.errors import FormatError
from iprt.files.images import read_color, read_depth, read_header
from iprt.files.orientation import as_stored

NEARLY_WHITE = 0.95
"""Fraction of the range of 8 or 16 bits from which colors may be clipped."""
SAME_ASPECT = 0.03
"""Relative difference in aspect ratio above which color and depth show different views."""
FARTHEST_STEP = 65535
"""Code of missing 16-bit depth, in 7-Scenes and from saturated sensors."""

Matrix = NDArray[np.float64]
Float = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Shot:
    """The files of one frame, and its rigid transform (4, 4) from the camera to the poses' world.

    The camera's axes are OpenCV's: +X right, +Y down, +Z ahead. `camera` belongs to the color
    picture. `depth_camera` is None if depth is registered to color.
    """

    color: Path
    depth: Path
    pose: Matrix
    camera: Pinhole
    depth_camera: Pinhole | None


@dataclass(frozen=True)
class RgbdFrame:
    """The decoded contents of a frame, in the pixels of its depth.

    Attributes
    ----------
    color : (H, W, 3) float32
        Linear radiance, finite, not negative.
    depth : (H, W) float32
        Metres along the camera's +Z, 0 where there is none.
    clipped : (H, W) bool
        The surface may be brighter than its color.
    camera : Pinhole
    """

    color: Float
    depth: Float
    clipped: Mask
    camera: Pinhole

    def glance(self) -> Glance:
        """Downsample the picture to a glance."""
        return Glance.of(self.depth, self.color, self.clipped, self.camera)


@dataclass(frozen=True)
class RgbdSequence:
    """The RGB-D frames of a folder, in order.

    Attributes
    ----------
    shots : tuple of Shot
        At least one.
    up : str
        Axis of the poses' world that points up.
    step_m : float
        Metres per step of integer depth.
    unit_m : float
        Metres per unit of floating-point depth.
    found : Found
        The layout.
    settled : Settled
        The convention of the poses.
    """

    shots: tuple[Shot, ...]
    up: Axis
    step_m: float
    unit_m: float
    found: Found
    settled: Settled

    @classmethod
    def open(cls, folder: Path, poses: Convention | None = None) -> RgbdSequence:
        """Open a folder: detect its layout, cameras and pose convention.

        Parameters
        ----------
        poses : str or None
            Convention of the poses. Default: chosen by the agreement of frames about depth.

        Raises
        ------
        FormatError, SceneError
            A file is missing or damaged, no frames are left, or poses do not fit depth.
        """
        if not folder.is_dir():
            what = "is a file; give its folder" if folder.exists() else "no such folder"
            raise FormatError(f"{folder}: {what}")
        table = read_camera_table(folder / CAMERA)
        found = _layout(folder, table)
        shots = _shots(folder, table, found)
        scale = table.depth_scale
        stored = np.stack([frame.pose for frame in found.frames])
        convention = poses or found.convention
        settled = Settled(convention, f"{WORDS[convention]} (--poses)")
        sequence = cls(shots, "y", scale or found.step_m, scale or 1.0, found, settled)
        if poses is None:
            numbers = sample(len(shots))
            glances = [sequence.read(number).glance() for number in numbers]
            settled = settle(str(folder), glances, stored[numbers], convention)
        turned = world_from_camera(stored, settled.convention)
        return replace(
            sequence,
            shots=tuple(replace(s, pose=pose) for s, pose in zip(shots, turned, strict=True)),
            up=table.up or up_axis(stored, settled.convention, found.up),
            settled=settled,
        )

    @cached_property
    def world_from_poses(self) -> Matrix:
        """(3, 3) rotation of the poses' world to +Y up."""
        return _upright(self.up)

    def positions(self) -> Matrix:
        """Return the (N, 3) camera positions, +Y up."""
        return np.stack([shot.pose[:3, 3] for shot in self.shots]) @ self.world_from_poses.T

    def pose(self, index: int, center: Matrix) -> Matrix:
        """Return the (4, 4) transform from camera axes to the scene: +Y up, origin at `center`."""
        pose = np.eye(4)
        pose[:3] = self.world_from_poses @ self.shots[index].pose[:3]
        pose[:3, 3] -= center
        return pose

    def read(self, index: int) -> RgbdFrame:
        """Read color and depth of one frame, in the pixels of depth.

        Raises
        ------
        FormatError
            A file is missing or damaged, or the two do not show the same view.
        """
        shot = self.shots[index]
        # Poses and intrinsics apply to the stored pixels, whatever their EXIF orientation.
        header = read_header(shot.color)
        color = as_stored(read_color(shot.color), header.orientation)
        depth, bits = read_depth(shot.depth)
        if bits == 8:
            raise FormatError(f"{shot.depth}: depth of 8 bits; expected 16 bits, or floats")
        (height, width), (rows, columns) = color.shape[:2], depth.shape
        camera = shot.camera.resized(width, height)
        if shot.depth_camera is not None:
            depth_camera = shot.depth_camera.resized(columns, rows)
        elif abs(columns * height / (rows * width) - 1.0) <= SAME_ASPECT:
            depth_camera = camera.resized(columns, rows)
        else:
            raise FormatError(
                f"{shot.depth}: {columns}x{rows} pixels, but its color has {width}x{height}: "
                "another view; register depth to color"
            )
        clipped = (color.max(axis=-1) >= NEARLY_WHITE) & header.has_end
        if depth_camera != camera:
            color, clipped = _seen_by(depth_camera, camera, color, clipped)
        there = np.isfinite(depth) & (depth > 0.0) & np.isfinite(color).all(axis=-1)
        if bits:
            there &= depth < FARTHEST_STEP
        color = np.maximum(np.nan_to_num(color, posinf=0.0, neginf=0.0), 0.0)
        metres = np.where(there, depth, 0.0) * (self.step_m if bits else self.unit_m)
        return RgbdFrame(color, metres.astype(np.float32), clipped, depth_camera)


def _layout(folder: Path, table: CameraTable) -> Found:
    """Detect the layout of a folder by its files, and read it."""
    if table.color is not None:
        return read_listed(folder, table.color, str(table.depth), str(table.poses))
    for read in (read_transforms, read_tum, read_per_frame, read_log, read_rows):
        found = read(folder)
        if found is not None:
            return found
    raise FormatError(
        f"{folder}: no sequence: neither transforms.json, rgb.txt and depth.txt, a folder pose, "
        "*.pose.txt, *.log, poses.txt with pictures in color and depth, nor a camera.toml that "
        "names pictures (docs/capture.md)"
    )


def _shots(folder: Path, table: CameraTable, found: Found) -> tuple[Shot, ...]:
    """Assign cameras to the frames; poses are as stored."""
    first = found.frames[0]
    camera, depth_camera = camera_of_table(table, first.color), None
    own = camera is None
    if own and first.camera is None:
        camera, depth_camera = cameras_of_files(folder, first.color, first.depth)
    shots = []
    for frame in found.frames:
        camera_of_frame = frame.camera if own and frame.camera is not None else camera
        if camera_of_frame is None:
            raise FormatError(
                f"{folder / CAMERA}: no such file; write one with fx, fy, cx, cy in pixels "
                "(docs/capture.md)"
            )
        shots.append(Shot(frame.color, frame.depth, frame.pose, camera_of_frame, depth_camera))
    return tuple(shots)


def _seen_by(
    depth_camera: Pinhole, camera: Pinhole, color: Float, clipped: Mask
) -> tuple[Float, Mask]:
    """Resample colors and clipping flags for another camera at the same place.

    Pixels outside the first camera's picture are NaN. Larger pictures are first averaged over
    blocks of about the size of the other's pixels.
    """
    step = max(1, round(min(camera.fx / depth_camera.fx, camera.fy / depth_camera.fy)))
    camera = camera.reduced(step)
    color = np.asarray(blocks(color, step)).mean(axis=(1, 3))
    limited = np.any(blocks(clipped, step), axis=(1, 3))
    column, row = camera.pixels(depth_camera.rays())
    both = np.concatenate([color, np.asarray(limited)[..., None]], axis=-1).astype(np.float32)
    seen = sampled(both, column, row)
    # The edges of pictures with nearly the same aspect may differ by a pixel.
    outside = (np.abs(column - (camera.width - 1) / 2) > camera.width / 2 + 1) | (
        np.abs(row - (camera.height - 1) / 2) > camera.height / 2 + 1
    )
    return np.where(outside[..., None], np.nan, seen[..., :3]), seen[..., 3] > 0.0


def _upright(up: Axis) -> Matrix:
    """Return the (3, 3) rotation that takes an axis to +Y by the shortest way."""
    axis = np.zeros(3)
    axis["xyz".index(up[-1])] = -1.0 if up.startswith("-") else 1.0
    if up[-1] == "y":
        return np.diag([1.0, axis[1], axis[1]])
    # Rows: the axes that become +X, +Y and +Z.
    x = np.array([0.0, -axis[0], 0.0]) if up[-1] == "x" else np.array([1.0, 0.0, 0.0])
    return np.stack([x, axis, np.cross(x, axis)])
