"""Decoded frames of a video: colour, depth and normals."""

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
from iprt.files.message_text import extent
from iprt.files.safe_reading import require_inside
from iprt.footage.video.depth_code import DepthCode, DepthSamples
from iprt.footage.video.placement import Placement, placement_of
from iprt.footage.video.poses import read_poses
from iprt.footage.video.reader import Streams, open_streams
from iprt.footage.video.table import VideoTable
from iprt.footage.video.tracks import StreamTrack, Tracks, depth_code, open_tracks

Picture = NDArray[np.float32]


class FrameSource:
    """The pictures that `[video]` names. Files are opened when they are needed.

    Parameters
    ----------
    root : Path
        The scene's folder.
    video : VideoTable
        The `[video]` table.
    within : Path
        Folder that must contain all files, after resolving links.
    """

    MAX_MISSING = 10_000
    """Largest number of missing files that are counted."""

    def __init__(self, root: Path, video: VideoTable, within: Path) -> None:
        self.root = root
        self._video, self._within = video, within

    @cached_property
    def tracks(self) -> Tracks:
        """Tracks and their clock; errors are those from `open_tracks`."""
        return open_tracks(self.root, self._video, self._within)

    @property
    def indices(self) -> range:
        """Indices of the frames."""
        return self.tracks.indices

    @property
    def fps(self) -> float:
        """Frames per second."""
        return self.tracks.fps

    @cached_property
    def _poses(self) -> NDArray[np.float64] | None:
        """Poses (frames, 4, 4), world from capture; None if there are none."""
        if self._video.poses is None:
            return None
        path = self.root / self._video.poses
        require_inside(path, self._within)
        return read_poses(path, len(self.indices))

    def pose(self, index: int) -> NDArray[np.float64] | None:
        """Return the pose (4, 4) of a frame, world from capture; None for the identity."""
        return None if self._poses is None else self._poses[index - self.indices[0]]

    @property
    def static_camera(self) -> bool:
        """Return whether several frames are captured from a single place."""
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
        """Radiance at which colour clips; infinite if it never does."""
        given = self._video.white
        if given is not None:
            return given
        return 1.0 if self.header.has_end else math.inf

    def files(self, index: int) -> dict[str, Path]:
        """Return the files of a frame by key: color, depth, and normal if there are normals."""
        return {key: track.file(index) for key, track in self.tracks.by_key.items()}

    def moment(self, index: int) -> tuple[Path, Fraction] | None:
        """Return the video file of a frame's colour, and its time in seconds on the file's clock.

        None if colour is stored as pictures.
        """
        track = self.tracks.by_key["color"]
        return (track.file(index), track.moment(index)) if isinstance(track, StreamTrack) else None

    @cached_property
    def missing(self) -> dict[str, list[Path]]:
        """Missing files by key, at most `MAX_MISSING` each; no empty lists."""
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
        """Placement of stored colour on the sphere; None if it covers all of it."""
        header, path = self.header, self.files(self.indices[0])["color"]
        size = header.width, header.height
        return placement_of(path, size, self._video.eye, self._video.fit, header.xmp)

    @contextmanager
    def decoding(self) -> Iterator[Decoder]:
        """Open a decoder of frames, quickest in order. Not for several threads at a time."""
        with open_streams() as streams:
            yield Decoder(self, streams)


class Decoder:
    """A decoder of a source's pictures, placed on the sphere; it holds their files open."""

    def __init__(self, source: FrameSource, streams: Streams) -> None:
        self.source = source
        self._readers: dict[str, Callable[[int], Any]] = {
            key: track.reader(streams) for key, track in source.tracks.by_key.items()
        }

    def color(self, index: int) -> Picture:
        """Decode linear radiance (H, W, 3).

        Raises
        ------
        FormatError
            If a file is damaged or missing, or differs in size from the first frame.
        """
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
        """Decode normals (H, W, 3); None if there are none."""
        if "normal" not in self._readers:
            return None
        normal: Picture = self._readers["normal"](index)
        placement = self.source.placement
        alike = None if placement is None else placement.alike(normal.shape[1], normal.shape[0])
        return normal if alike is None else alike.nearest(normal)
