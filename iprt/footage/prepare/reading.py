"""Raw frames in metres, at one size and in the scene's orientation: stages 1 to 4."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.message_text import extent
from iprt.footage.prepare.enlarge import at_full_size
from iprt.footage.prepare.metres import StoredDepth
from iprt.footage.prepare.turn import turned_color, turned_geometry
from iprt.footage.video.depth_code import DepthSamples, usable
from iprt.footage.video.mistaken_depth import require_no_picture
from iprt.footage.video.placement import shape_problem
from iprt.footage.video.reader import Streams, open_streams
from iprt.footage.video.source import FrameSource

Picture = NDArray[np.float32]


@dataclass(frozen=True)
class RawFrame:
    """Decoded frame, in metres and in the scene's orientation.

    Attributes
    ----------
    color : (H, W, 3) float32
        Linear radiance; possibly negative or not finite.
    depth : (H, W) float32
        Metres; 0, negative, NaN or inf where there is no surface.
    normal : (H, W, 3) float32 or None
        World-space normals as in `Frame`.
    index, pose
        As in `Frame`.
    """

    color: Picture
    depth: Picture
    normal: Picture | None
    index: int = 0
    pose: NDArray[np.float64] | None = None


class RawFrames:
    """Raw frames of a source, with the storage format of their depth, found in the first frame."""

    def __init__(self, source: FrameSource) -> None:
        self.source = source
        self._first: DepthSamples | None = None  # decoded for `stored_depth`, and not yet read

    @cached_property
    def stored_depth(self) -> StoredDepth | None:
        """Storage of depth, from the first frame of the video; None if that cannot be read."""
        try:
            with self.reading() as reader:
                samples = reader.depth(self.source.indices[0])
            self._first = samples
            return self._stored(samples)
        except FormatError:
            return None

    def decoded(self, index: int) -> DepthSamples | None:
        """Return the depth of a frame if it is decoded already; the next call has nothing."""
        samples, self._first = self._first, None
        return samples if index == self.source.indices[0] else None

    def first_depth(self, samples: DepthSamples) -> None:
        """Set `stored_depth` from samples of the first frame, to avoid decoding them again."""
        if "stored_depth" not in vars(self):
            self.stored_depth = self._stored(samples)

    def _stored(self, samples: DepthSamples) -> StoredDepth:
        path = self.source.files(self.source.indices[0])["depth"]
        return StoredDepth.of(path, samples, self.source.code)

    @contextmanager
    def reading(self) -> Iterator[FrameReader]:
        """Open a reader of frames, quickest in order. Not for several threads at a time."""
        with open_streams() as streams:
            yield FrameReader(self, streams)

    def read(self, index: int) -> RawFrame:
        """Read one frame; see `FrameReader`."""
        with self.reading() as reader:
            return reader.read(index)


class FrameReader:
    """A reader of frames that holds their files open."""

    def __init__(self, frames: RawFrames, streams: Streams) -> None:
        self._frames, self._source = frames, frames.source
        self._placement = self._source.placement
        self._readers: dict[str, Callable[[int], Any]] = {
            key: track.reader(streams) for key, track in self._source.tracks.by_key.items()
        }

    def read(self, index: int) -> RawFrame:
        """Read a frame; errors are those from `color` and `completed`."""
        return self.completed(index, self.color(index))

    def color(self, index: int) -> Picture:
        """Read linear radiance (H, W, 3) as in `RawFrame`.

        Raises
        ------
        FormatError
            If a file is damaged, missing, not 2:1, of another size than the first frame, or
            without a single finite value.
        """
        color: Picture = self._readers["color"](index)
        path = self._source.files(index)["color"]
        if self._placement is not None:
            _require_size(path, color, self._placement.stored, "the first frame")
            color = self._placement.color(color)
        height, width = color.shape[:2]
        if width != 2 * height:
            raise FormatError(f"{path}: {shape_problem(color)}")
        _require_size(path, color, self._source.size, "the first frame")
        _require_any(path, np.isfinite(color), "color is NaN or infinite everywhere")
        return turned_color(color, self._source.yaw_offset_deg)

    def completed(self, index: int, color: Picture) -> RawFrame:
        """Read depth, normals and pose of a frame whose color is read.

        Raises
        ------
        FormatError
            If a file is damaged or missing, depth is larger than color or not 2:1, normals have
            another size than color, integer depth has no scale, depth has no usable value, or
            the depth of the first frame is a picture.
        """
        path, code = self._source.files(index)["depth"], self._source.code
        samples = self.depth(index)
        if index == self._source.indices[0]:
            self._frames.first_depth(samples)
        stored = self._frames.stored_depth or StoredDepth.of(path, samples, code)
        depth = stored.metres(path, samples, code)
        full = self._full_depth(path, depth, stored)
        _require_any(path, usable(depth), "no depth: all values are 0, negative, NaN or infinite")
        turned = turned_geometry(full, self._normal(index), self._source.yaw_offset_deg)
        if index == self._source.indices[0]:
            require_no_picture(path, turned[0], color, code)
        return RawFrame(color, *turned, index, self.pose(index))

    def pose(self, index: int) -> NDArray[np.float64] | None:
        """Return the pose of a frame; see `FrameSource.pose`."""
        return self._source.pose(index)

    def depth(self, index: int) -> DepthSamples:
        """Read depth as stored, placed on the sphere."""
        decoded = self._frames.decoded(index)
        if decoded is not None:
            return decoded
        samples: DepthSamples = self._readers["depth"](index)
        return samples if self._placement is None else samples.placed(self._placement)

    def _normal(self, index: int) -> Picture | None:
        if "normal" not in self._readers:
            return None
        normal: Picture = self._readers["normal"](index)
        alike = self._placement and self._placement.alike(normal.shape[1], normal.shape[0])
        if alike is not None:
            normal = alike.nearest(normal)
        path = self._source.files(index)["normal"]
        _require_size(path, normal, self._source.size, "color")
        require_unit(path, normal)
        return normal

    def _full_depth(self, path: Path, depth: Picture, stored: StoredDepth) -> Picture:
        """Return depth at the size of color."""
        size = self._source.size
        columns, rows = own = depth.shape[1], depth.shape[0]
        if columns != 2 * rows or rows > size[1]:
            raise FormatError(
                f"{path}: {extent(own)} pixels, but color has {extent(size)}; depth needs the "
                "same size, or a smaller one twice as wide as high"
            )
        if own != stored.size:
            raise FormatError(
                f"{path}: {extent(own)} pixels, but the first frame has {extent(stored.size)}"
            )
        return at_full_size(depth, stored.grid, *size)


def _require_size(path: Path, picture: Picture, size: tuple[int, int], other: str) -> None:
    own = picture.shape[1], picture.shape[0]
    if own != size:
        raise FormatError(f"{path}: {extent(own)} pixels, but {other} has {extent(size)}")


def _require_any(path: Path, usable: NDArray[np.bool_], problem: str) -> None:
    if not usable.any():
        raise FormatError(f"{path}: {problem}; export it again")


def require_unit(path: Path, normal: Picture) -> None:
    """Raise FormatError if most vectors are not of length 1, and therefore no normals."""
    with np.errstate(all="ignore"):
        length = np.linalg.norm(normal, axis=-1)
    given = length[np.isfinite(length) & (length > 0.0)]
    unit = float((np.abs(given - 1.0) < 0.2).mean()) if given.size else 1.0
    if unit < 0.5:
        raise FormatError(
            f"{path}: holds no normals: {1.0 - unit:.0%} of its values are not of length 1; "
            "expected x, y, z from -1 to 1 in world space; without this file, normals are fitted "
            "to depth"
        )
