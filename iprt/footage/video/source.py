"""The source of a video's frames: its tracks, poses, and placement on the sphere."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cached_property
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.files.images import Header
from iprt.files.safe_reading import require_inside
from iprt.footage.video.depth_code import DepthCode
from iprt.footage.video.placement import Placement, placement_of
from iprt.footage.video.poses import read_poses
from iprt.footage.video.tracks import StreamTrack, Tracks, depth_code, open_tracks
from iprt.footage.video.video_table import VideoTable


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
        """Radiance at which color clips; infinite if it never does."""
        given = self._video.white
        if given is not None:
            return given
        return 1.0 if self.header.has_end else math.inf

    def files(self, index: int) -> dict[str, Path]:
        """Return the files of a frame by key: color, depth, and normal if there are normals."""
        return {key: track.file(index) for key, track in self.tracks.by_key.items()}

    def moment(self, index: int) -> tuple[Path, Fraction] | None:
        """Return the video file of a frame's color, and its time in seconds on the file's clock.

        None if color is stored as pictures.
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
        """Width and height of the panorama, from the header of the first color picture."""
        header, placement = self.header, self.placement
        return (header.width, header.height) if placement is None else placement.size

    @cached_property
    def header(self) -> Header:
        """Header of the first color picture."""
        return self.tracks.by_key["color"].header()

    @cached_property
    def placement(self) -> Placement | None:
        """Placement of stored color on the sphere; None if it covers all of it."""
        header, path = self.header, self.files(self.indices[0])["color"]
        size = header.width, header.height
        return placement_of(path, size, self._video.eye, self._video.fit, header.xmp)
