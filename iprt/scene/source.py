"""Pictures of a 360° video to sanitised frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.scene.depth import sanitise_color, sanitise_depth
from iprt.scene.frame import Frame
from iprt.scene.images import file_kind, picture_size, read_color, read_depth, read_normal
from iprt.scene.inside import require_inside
from iprt.scene.manifest import VideoTable
from iprt.scene.manifest_problems import FRAME_PATTERN
from iprt.scene.normals import estimate_normals, sanitise_normals
from iprt.scene.untrusted import is_file

Picture = NDArray[np.float32]
MAX_MISSING = 10_000
"""Frames without a file that are counted."""


def frame_path(root: Path, pattern: str, index: int) -> Path:
    """The file of frame `index` that a printf pattern names."""
    return root / FRAME_PATTERN.sub(lambda match: match[0] % index, pattern)


@dataclass(frozen=True)
class RawFrame:
    """A frame as its files have it, in metres and turned to the scene's convention.

    Attributes
    ----------
    color : (H, W, 3) float32
        Linear radiance; possibly negative or not finite.
    depth : (H, W) float32
        Metres; 0, negative, NaN or inf where there is no surface.
    normal : (H, W, 3) float32 or None
    """

    color: Picture
    depth: Picture
    normal: Picture | None

    def sanitised(self) -> Frame:
        """Fill holes and find normals; see `sanitise_depth` and `estimate_normals`."""
        color = sanitise_color(self.color)
        clean = sanitise_depth(self.depth, color)
        normal = estimate_normals(clean.depth, clean.opening.astype(np.uint8))
        if self.normal is not None:
            normal = sanitise_normals(self.normal, normal)
        return Frame(color, clean.depth, clean.opening, normal)


class FrameSource:
    """The pictures that `[video]` names.

    Parameters
    ----------
    root : Path
        The scene's folder.
    video : VideoTable
    within : Path
        Folder that the pictures must lie in, links followed.
    """

    def __init__(self, root: Path, video: VideoTable, within: Path) -> None:
        self._root, self._video, self._within = root, video, within
        first, last = video.frames
        self.indices = range(first, last + 1)

    def files(self, index: int) -> dict[str, Path]:
        """The files of a frame by their key: color, depth, and normal where there are any."""
        video = self._video
        named = {"color": video.color, "depth": video.depth, "normal": video.normal}
        return {
            key: frame_path(self._root, pattern, index)
            for key, pattern in named.items()
            if pattern is not None
        }

    def problems(self) -> list[str]:
        """Missing files, links elsewhere, and depth without a unit; one line each."""
        problems = []
        for key in self.files(self.indices[0]):
            missing = list(islice((f for f in self._all(key) if not is_file(f)), MAX_MISSING))
            if missing:
                name = missing[0].relative_to(self._root)
                least = "at least " if len(missing) == MAX_MISSING else ""
                more = f" (and {least}{len(missing) - 1} more frames)" if len(missing) > 1 else ""
                problems.append(f"video.{key}: there is no file {name}{more}")
                continue
            try:
                self._require_inside(key)
            except FormatError as error:
                problems.append(f"video.{key}: {error}")
        depth = self.files(self.indices[0])["depth"]
        if self._video.depth_scale is None and not any("video.depth:" in p for p in problems):
            try:
                integers = file_kind(depth) == "png"
            except FormatError as error:
                return [*problems, f"video.depth: {error}"]
            if integers:
                problems.append(_scale_problem(depth.name))
        return problems

    def _all(self, key: str) -> Iterator[Path]:
        """The files of all frames."""
        pattern = getattr(self._video, key)
        indices = self.indices if FRAME_PATTERN.search(pattern) else self.indices[:1]
        return (frame_path(self._root, pattern, index) for index in indices)

    def _require_inside(self, key: str) -> None:
        folders: set[Path] = set()
        for file in self._all(key):
            if file.parent not in folders or file.is_symlink():
                require_inside(file, self._within)
                folders.add(file.parent)

    def size(self) -> tuple[int, int]:
        """Width and height of the first colour picture, from its header."""
        return picture_size(self.files(self.indices[0])["color"])

    def read(self, index: int) -> RawFrame:
        """Read a frame's files.

        Raises
        ------
        FormatError
            Damaged files, sizes that differ or are not 2:1, integer depth without a scale, colour
            or depth without a single usable value.
        """
        files, video = self.files(index), self._video
        color = read_color(files["color"])
        height, width = color.shape[:2]
        if width != 2 * height:
            raise FormatError(
                f"{files['color']}: {width} x {height} pixels; an equirect panorama is twice as "
                "wide as high"
            )
        depth, integers = read_depth(files["depth"])
        if integers and video.depth_scale is None:
            raise FormatError(f"{files['depth']}: {_scale_problem(files['depth'].name)}")
        _require_size(files["depth"], depth, color)
        _require_any(files["color"], np.isfinite(color), "colour is NaN or infinite everywhere")
        with np.errstate(all="ignore"):
            depth = depth * np.float32(video.depth_scale or 1.0)
        _require_any(
            files["depth"],
            np.isfinite(depth) & (depth > 0.0),
            "no depth: all values are 0, negative, NaN or infinite",
        )
        normal = None
        if "normal" in files:
            normal = read_normal(files["normal"])
            _require_size(files["normal"], normal, color)
        return turned(RawFrame(color, depth, normal), video.yaw_offset_deg)


def turned(frame: RawFrame, yaw_deg: float) -> RawFrame:
    """Turn the world to the right, towards +X: what lay at azimuth a comes to a + yaw.

    Colour is interpolated between columns; depth and normals come from the nearest column, because
    they jump at edges. Normals turn with the world.
    """
    columns = yaw_deg / 360.0 * frame.color.shape[1]
    whole = int(np.floor(columns))
    part = np.float32(columns - whole)
    color = np.roll(frame.color, whole, axis=1)
    if part > 1e-4:
        color = (1 - part) * color + part * np.roll(color, 1, axis=1)
    nearest = int(np.floor(columns + 0.5))
    normal = frame.normal
    if normal is not None and yaw_deg % 360.0 != 0.0:
        angle = np.deg2rad(yaw_deg)
        cos, sin = np.float32(np.cos(angle)), np.float32(np.sin(angle))
        x, y, z = np.moveaxis(np.roll(normal, nearest, axis=1), -1, 0)
        normal = np.stack([cos * x - sin * z, y, sin * x + cos * z], axis=-1)
    return RawFrame(color, np.roll(frame.depth, nearest, axis=1), normal)


def _scale_problem(name: str) -> str:
    return (
        f"video.depth_scale: {name} stores integers; say how many metres one step is "
        "(0.001 for millimetres)"
    )


def _require_size(path: Path, picture: NDArray[np.generic], color: Picture) -> None:
    if picture.shape[:2] != color.shape[:2]:
        raise FormatError(
            f"{path}: {picture.shape[1]} x {picture.shape[0]} pixels, "
            f"but colour has {color.shape[1]} x {color.shape[0]}"
        )


def _require_any(path: Path, usable: NDArray[np.bool_], problem: str) -> None:
    if not usable.any():
        raise FormatError(f"{path}: {problem}; export it again")
