"""The source of a video's frames: tracks of colour, depth and normals, decoded."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
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
from iprt.files.wording import extent
from iprt.footage.video.depth_code import DepthCode, DepthSamples
from iprt.footage.video.placement import Placement, placement_of
from iprt.footage.video.poses import read_poses
from iprt.footage.video.reader import Streams, open_streams
from iprt.footage.video.table import VideoTable
from iprt.footage.video.tracks import StreamTrack, Tracks, depth_code, open_tracks

Picture = NDArray[np.float32]


class FrameSource:
    """The pictures that `[video]` names. Files are opened when something of them is asked for.

    Parameters
    ----------
    root : Path
        The scene's folder.
    within : Path
        Folder that the pictures must lie in, links followed.
    """

    MAX_MISSING = 10_000
    """Frames without a file that are counted."""

    def __init__(self, root: Path, video: VideoTable, within: Path) -> None:
        self.root = root
        self._video, self._within = video, within

    @cached_property
    def tracks(self) -> Tracks:
        """The tracks and their clock; raises as `open_tracks`."""
        return open_tracks(self.root, self._video, self._within)

    @property
    def indices(self) -> range:
        """Numbers of the frames."""
        return self.tracks.indices

    @property
    def fps(self) -> float:
        """Frames per second."""
        return self.tracks.fps

    @cached_property
    def _poses(self) -> NDArray[np.float64] | None:
        """(frames, 4, 4), world from capture."""
        if self._video.poses is None:
            return None
        path = self.root / self._video.poses
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

    @property
    def yaw_offset_deg(self) -> float:
        """Angle by which the world is turned to the right."""
        return self._video.yaw_offset_deg

    @cached_property
    def white(self) -> float:
        """Radiance from which on colour is clipped; infinite where it never is."""
        given = self._video.white
        if given is not None:
            return given
        return 1.0 if self.header.has_end else math.inf

    def files(self, index: int) -> dict[str, Path]:
        """The files of a frame by their key: color, depth, and normal where there are any."""
        return {key: track.file(index) for key, track in self.tracks.by_key.items()}

    def moment(self, index: int) -> tuple[Path, Fraction] | None:
        """The video file that shows a frame's colour, and when, in seconds on the file's clock.

        None: colour is in pictures.
        """
        track = self.tracks.by_key["color"]
        return (track.file(index), track.moment(index)) if isinstance(track, StreamTrack) else None

    @cached_property
    def missing(self) -> dict[str, list[Path]]:
        """Files that are not there by their key, at most `MAX_MISSING` each; no empty lists."""
        files = {
            key: list(islice(track.missing(), self.MAX_MISSING))
            for key, track in self.tracks.by_key.items()
        }
        return {key: missing for key, missing in files.items() if missing}

    @cached_property
    def size(self) -> tuple[int, int]:
        """Width and height of the panorama, from the header of the first colour picture."""
        header, placement = self.header, self.placement
        return (header.width, header.height) if placement is None else placement.size

    @cached_property
    def header(self) -> Header:
        """Header of the first colour picture."""
        return self.tracks.by_key["color"].header()

    @cached_property
    def placement(self) -> Placement | None:
        """Place of stored colour in the sphere; None where it covers all of it."""
        header, path = self.header, self.files(self.indices[0])["color"]
        size = header.width, header.height
        return placement_of(path, size, self._video.eye, self._video.fit, header.xmp)

    @contextmanager
    def decoding(self) -> Iterator[Decoder]:
        """A decoder of frames, quickest in order. Not for several threads at a time."""
        with open_streams() as streams:
            yield Decoder(self, streams)


class Decoder:
    """Decodes the pictures of a source, whose files it holds open, as they lie in the sphere."""

    def __init__(self, source: FrameSource, streams: Streams) -> None:
        self.source = source
        self._readers: dict[str, Callable[[int], Any]] = {
            key: track.reader(streams) for key, track in source.tracks.by_key.items()
        }

    def color(self, index: int) -> Picture:
        """Decode linear radiance (H, W, 3); FormatError as of the first frame's placement."""
        color: Picture = self._readers["color"](index)
        placement = self.source.placement
        if placement is None:
            return color
        own = color.shape[1], color.shape[0]
        if own != placement.stored:
            raise FormatError(
                f"{self.source.files(index)['color']}: {extent(own)} pixels, but the first frame "
                f"has {extent(placement.stored)}"
            )
        return placement.color(color)

    def depth(self, index: int) -> DepthSamples:
        """Decode depth as stored."""
        samples: DepthSamples = self._readers["depth"](index)
        placement = self.source.placement
        return samples if placement is None else samples.placed(placement)

    def normal(self, index: int) -> Picture | None:
        """Decode normals (H, W, 3); None where there are none."""
        if "normal" not in self._readers:
            return None
        normal: Picture = self._readers["normal"](index)
        placement = self.source.placement
        alike = None if placement is None else placement.alike(normal.shape[1], normal.shape[0])
        return normal if alike is None else alike.nearest(normal)
