"""The source of a video's frames: tracks of colour, depth and normals."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.images import Header
from iprt.files.path_safety import require_inside
from iprt.footage.coarse_depth import at_full_size
from iprt.footage.depth import sanitise_color, sanitise_depth
from iprt.footage.frame import Frame
from iprt.footage.noisy_depth import smoothed
from iprt.footage.video.depth_code import DepthCode, DepthSamples
from iprt.footage.video.mistaken_depth import require_no_picture
from iprt.footage.video.placement import Placement, placement_of, shape_problem
from iprt.footage.video.poses import read_poses
from iprt.footage.video.reader import Streams, open_streams
from iprt.footage.video.stored_depth import StoredDepth
from iprt.footage.video.table import VideoTable
from iprt.footage.video.tracks import StreamTrack, Tracks, depth_code, open_tracks
from iprt.footage.video.turning import turned_color, turned_geometry

Picture = NDArray[np.float32]
MAX_MISSING = 10_000
"""Frames without a file that are counted."""


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
    index, pose
        As in `Frame`.
    """

    color: Picture
    depth: Picture
    normal: Picture | None
    index: int = 0
    pose: NDArray[np.float64] | None = None

    def sanitised(self) -> Frame:
        """Smooth noise and fill holes; see `smoothed` and `sanitise_depth`."""
        color = sanitise_color(self.color)
        clean = sanitise_depth(smoothed(self.depth), color)
        return Frame(
            color, clean.depth, clean.opening, self.normal, index=self.index, pose=self.pose
        )


class FrameSource:
    """The pictures that `[video]` names. Files are opened when something of them is asked for.

    Parameters
    ----------
    root : Path
        The scene's folder.
    within : Path
        Folder that the pictures must lie in, links followed.
    """

    def __init__(self, root: Path, video: VideoTable, within: Path) -> None:
        self._root, self._video, self._within = root, video, within

    @cached_property
    def _tracks(self) -> Tracks:
        return open_tracks(self._root, self._video, self._within)

    @property
    def indices(self) -> range:
        """Numbers of the frames."""
        return self._tracks.indices

    @property
    def fps(self) -> float:
        """Frames per second."""
        return self._tracks.fps

    @cached_property
    def _poses(self) -> NDArray[np.float64] | None:
        """(frames, 4, 4), world from capture."""
        if self._video.poses is None:
            return None
        path = self._root / self._video.poses
        require_inside(path, self._within)
        return read_poses(path, len(self.indices))

    def pose(self, index: int) -> NDArray[np.float64] | None:
        """(4, 4) world from the capture centre and axes of a frame; None: they are the world's."""
        return None if self._poses is None else self._poses[index - self.indices[0]]

    @property
    def static_camera(self) -> bool:
        """Do several frames show what is around one place?"""
        stays = self._poses is None or bool((self._poses == self._poses[:1]).all())
        return stays and len(self.indices) > 1

    @property
    def code(self) -> DepthCode:
        """Meaning of stored depth."""
        return depth_code(self._video)

    @cached_property
    def white(self) -> float:
        """Radiance from which on colour is clipped; infinite where it never is."""
        given = self._video.white
        if given is not None:
            return given
        return 1.0 if self._header.has_end else math.inf

    def files(self, index: int) -> dict[str, Path]:
        """The files of a frame by their key: color, depth, and normal where there are any."""
        return {key: track.file(index) for key, track in self._tracks.by_key.items()}

    def moment(self, index: int) -> tuple[Path, Fraction] | None:
        """The video file that shows a frame's colour, and when, in seconds on the file's clock.

        None: colour is in pictures.
        """
        track = self._tracks.by_key["color"]
        return (track.file(index), track.moment(index)) if isinstance(track, StreamTrack) else None

    @cached_property
    def _missing(self) -> dict[str, str]:
        """By key, the frames that have no file."""
        lines = {}
        for key, track in self._tracks.by_key.items():
            missing = list(islice(track.missing(), MAX_MISSING))
            if missing:
                least = "at least " if len(missing) == MAX_MISSING else ""
                more = f" (and {least}{len(missing) - 1} more frames)" if len(missing) > 1 else ""
                lines[key] = f"there is no file {missing[0].relative_to(self._root)}{more}"
        return lines

    def problems(self, *, strict: bool = False) -> list[str]:
        """Reasons why the video cannot be read; one line each.

        The first frame without a file, links elsewhere, and depth without a unit. If `strict`, any
        frame without a file.
        """
        problems = []
        try:
            tracks = self._tracks.by_key
        except FormatError as error:
            return [str(error)]
        for key, track in tracks.items():
            first = next(track.missing(), None) == track.file(self.indices[0])
            if key in self._missing and (first or strict):
                problems.append(f"video.{key}: {self._missing[key]}")
            else:
                problems += track.problems()
        try:
            self.pose(self.indices[0])
        except FormatError as error:
            problems += [f"video.poses: {line}" for line in error.lines]
        return problems

    def notices(self) -> list[str]:
        """Gaps that the reader of the video fills; one line each."""
        gaps = [
            f"video.{key}: {line}; the one before it stays" for key, line in self._missing.items()
        ]
        return gaps + self.disagreements()

    def disagreements(self) -> list[str]:
        """Disagreements of the streams, and how they are resolved; one line each."""
        return self._tracks.disagreements

    def remarks(self) -> list[str]:
        """Return remarks on unread parts of colour, on its share of the sphere, and on depth."""
        path, placement = self.files(self.indices[0])["color"], self.placement
        lines = []
        if self._header.unread:
            lines.append(f"video.color: {path.name} {self._header.unread}")
        if placement is not None and placement.known < 0.99999:
            lines.append(
                f"video.color: {path.name} covers {100 * placement.known:.3g}% of the sphere; the "
                "rest is unknown: black, without a surface, and gives no light"
            )
        return lines + self.interpolation()

    def interpolation(self) -> list[str]:
        """At most one line: that depth has fewer values than colour, and what is done about it."""
        stored = self.stored_depth
        if stored is None or (stored.grid is None and stored.size == self.size):
            return []
        name = self.files(self.indices[0])["depth"].name
        what = f"video.depth: {name} has {_by(stored.size)} pixels"
        if stored.grid is not None:
            what += f", enlarged from {_by(stored.grid.size)} by repeating them"
        if stored.size != self.size:
            what += f"; colour has {_by(self.size)}"
        return [f"{what}; depth is interpolated along surfaces"]

    @cached_property
    def stored_depth(self) -> StoredDepth | None:
        """How depth is stored, by the first frame wherever reading begins; None: it has none."""
        first = self.indices[0]
        try:
            with open_streams() as streams:
                samples = self._readers(streams)["depth"](first)
            return StoredDepth.of(self.files(first)["depth"], samples, self.code)
        except FormatError:
            return None

    def first_depth(self, samples: DepthSamples) -> None:
        """Take the depth of the first frame, which need not be read for `stored_depth`."""
        if "stored_depth" not in vars(self):
            path = self.files(self.indices[0])["depth"]
            self.stored_depth = StoredDepth.of(path, samples, self.code)

    def doubts(self) -> list[str]:
        """Return guesses about stored depth, and doubts; one line each."""
        return [] if self.stored_depth is None else list(self.stored_depth.doubts)

    @cached_property
    def size(self) -> tuple[int, int]:
        """Width and height of the panorama, from the header of the first colour picture."""
        header, placement = self._header, self.placement
        return (header.width, header.height) if placement is None else placement.size

    @cached_property
    def _header(self) -> Header:
        return self._tracks.by_key["color"].header()

    @cached_property
    def placement(self) -> Placement | None:
        """Place of stored colour in the sphere; None where it covers all of it."""
        header, path = self._header, self.files(self.indices[0])["color"]
        size = header.width, header.height
        return placement_of(path, size, self._video.eye, self._video.fit, header.xmp)

    def _readers(self, streams: Streams) -> dict[str, Callable[[int], Any]]:
        """Functions that read the pictures of a frame by their key, as they lie in the sphere."""
        tracks = self._tracks.by_key
        return {key: self._placing(key, track.reader(streams)) for key, track in tracks.items()}

    def _placing(self, key: str, read: Callable[[int], Any]) -> Callable[[int], Any]:
        def placed(index: int) -> Any:
            picture, placement = read(index), self.placement
            if placement is None:
                return picture
            if key == "depth":
                return picture.placed(placement)
            own = picture.shape[1], picture.shape[0]
            if key == "normal":
                alike = placement.alike(*own)
                return picture if alike is None else alike.nearest(picture)
            if own != placement.stored:
                raise FormatError(
                    f"{self.files(index)[key]}: {_by(own)} pixels, but the first frame has "
                    f"{_by(placement.stored)}"
                )
            return placement.color(picture)

        return placed

    @contextmanager
    def reading(self) -> Iterator[FrameReader]:
        """A reader of frames, quickest in order. Not for several threads at a time."""
        with open_streams() as streams:
            yield FrameReader(self, self._readers(streams), self._video.yaw_offset_deg)

    def read(self, index: int) -> RawFrame:
        """Read one frame; see `FrameReader`."""
        with self.reading() as reader:
            return reader.read(index)


class FrameReader:
    """Reads frames of a source, whose files it holds open."""

    def __init__(
        self, source: FrameSource, readers: dict[str, Callable[[int], Any]], yaw_deg: float
    ) -> None:
        self._source, self._readers, self._yaw_deg = source, readers, yaw_deg

    def read(self, index: int) -> RawFrame:
        """A frame; raises as `color` and `completed` do."""
        return self.completed(index, self.color(index))

    def color(self, index: int) -> Picture:
        """(H, W, 3) linear radiance as in `RawFrame`.

        Raises
        ------
        FormatError
            A damaged or missing file, not 2:1 or of another size than the first frame, or without
            a single usable value.
        """
        color: Picture = self._readers["color"](index)
        path = self._source.files(index)["color"]
        height, width = color.shape[:2]
        if width != 2 * height:
            raise FormatError(f"{path}: {shape_problem(color)}")
        self._require_size(path, color, "the first frame")
        _require_any(path, np.isfinite(color), "colour is NaN or infinite everywhere")
        return turned_color(color, self._yaw_deg)

    def completed(self, index: int, color: Picture) -> RawFrame:
        """A frame of which colour is read: depth in metres, and normals where there are any.

        Raises
        ------
        FormatError
            A damaged or missing file, depth that is larger than colour or not 2:1, normals of
            another size than colour, integer depth without a scale, depth without a single
            usable value, or, of the first frame, depth that is a picture.
        """
        files = self._source.files(index)
        samples: DepthSamples = self._readers["depth"](index)
        if index == self._source.indices[0]:
            self._source.first_depth(samples)
        code = self._source.code
        stored = self._source.stored_depth or StoredDepth.of(files["depth"], samples, code)
        depth = stored.metres(files["depth"], samples, code)
        full = self._full_depth(files["depth"], depth, stored)
        _require_any(
            files["depth"],
            np.isfinite(depth) & (depth > 0.0),
            "no depth: all values are 0, negative, NaN or infinite",
        )
        normal = None
        if "normal" in files:
            normal = self._readers["normal"](index)
            self._require_size(files["normal"], normal, "colour")
            require_unit(files["normal"], normal)
        turned = turned_geometry(full, normal, self._yaw_deg)
        if index == self._source.indices[0]:
            require_no_picture(files["depth"], turned[0], color, code)
        return RawFrame(color, *turned, index, self.pose(index))

    def pose(self, index: int) -> NDArray[np.float64] | None:
        """As `FrameSource.pose`."""
        return self._source.pose(index)

    def _full_depth(self, path: Path, depth: Picture, stored: StoredDepth) -> Picture:
        """Depth at the size of colour."""
        size = self._source.size
        columns, rows = own = depth.shape[1], depth.shape[0]
        if columns != 2 * rows or rows > size[1]:
            raise FormatError(
                f"{path}: {_by(own)} pixels, but colour has {_by(size)}; depth needs the same "
                "size, or a smaller one twice as wide as high"
            )
        if own != stored.size:
            raise FormatError(
                f"{path}: {_by(own)} pixels, but the first frame has {_by(stored.size)}"
            )
        return at_full_size(depth, stored.grid, *size)

    def _require_size(self, path: Path, picture: Picture, other: str) -> None:
        size, own = self._source.size, (picture.shape[1], picture.shape[0])
        if own != size:
            raise FormatError(f"{path}: {_by(own)} pixels, but {other} has {_by(size)}")


def _by(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]}"


def _require_any(path: Path, usable: NDArray[np.bool_], problem: str) -> None:
    if not usable.any():
        raise FormatError(f"{path}: {problem}; export it again")


def require_unit(path: Path, normal: Picture) -> None:
    """Raise FormatError for what can be no normals: most vectors are not of length 1."""
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
