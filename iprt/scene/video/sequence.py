"""A video as files: a picture per frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.scene.images import file_kind, picture_size, read_depth
from iprt.scene.inside import require_inside
from iprt.scene.manifest_problems import FRAME_PATTERN
from iprt.scene.untrusted import is_file

Picture = NDArray[np.float32]


def frame_path(root: Path, pattern: str, index: int) -> Path:
    """The file of frame `index` that a printf pattern names."""
    return root / FRAME_PATTERN.sub(lambda match: match[0] % index, pattern)


class PictureTrack:
    """One picture, or one per frame that a printf pattern names.

    Parameters
    ----------
    key, pattern : str
        In `[video]`.
    root : Path
        The scene's folder.
    indices : range
        Of the frames.
    within : Path
        Folder that the files must lie in, links followed.
    read : callable
        Path to picture.
    """

    def __init__(
        self,
        key: str,
        pattern: str,
        root: Path,
        indices: range,
        within: Path,
        read: Callable[[Path], Picture],
    ) -> None:
        self.key, self._root, self._pattern = key, root, pattern
        self._within, self._read = within, read
        self._indices = indices if FRAME_PATTERN.search(pattern) else indices[:1]

    def file(self, index: int) -> Path:
        return frame_path(self._root, self._pattern, index)

    def _files(self) -> Iterator[Path]:
        return (self.file(index) for index in self._indices)

    def missing(self) -> Iterator[Path]:
        return (file for file in self._files() if not is_file(file))

    def problems(self) -> list[str]:
        folders: set[Path] = set()
        try:
            for file in self._files():
                if file.parent not in folders or file.is_symlink():
                    require_inside(file, self._within)
                    folders.add(file.parent)
        except FormatError as error:
            return [f"video.{self.key}: {error}"]
        return []

    def size(self) -> tuple[int, int]:
        return picture_size(self.file(self._indices[0]))

    @contextmanager
    def reading(self) -> Iterator[Callable[[int], Picture]]:
        yield lambda index: self._read(self.file(index))


class DepthTrack(PictureTrack):
    """As `PictureTrack`, of depth in metres.

    Parameters
    ----------
    scale : float or None
        Metres per stored unit; needed where depth is stored as integers.
    """

    def __init__(
        self, pattern: str, root: Path, indices: range, within: Path, scale: float | None
    ) -> None:
        super().__init__("depth", pattern, root, indices, within, self._metres)
        self._scale = scale

    def problems(self) -> list[str]:
        problems = super().problems()
        if self._scale is None and not problems:
            first = self.file(self._indices[0])
            try:
                if file_kind(first) == "png":
                    problems.append(_scale_problem(first.name))
            except FormatError as error:
                problems.append(f"video.{self.key}: {error}")
        return problems

    def _metres(self, path: Path) -> Picture:
        depth, integers = read_depth(path)
        if integers and self._scale is None:
            raise FormatError(f"{path}: {_scale_problem(path.name)}")
        with np.errstate(all="ignore"):
            return depth * np.float32(self._scale or 1.0)


def _scale_problem(name: str) -> str:
    return (
        f"video.depth_scale: {name} stores integers; say how many metres one step is "
        "(0.001 for millimetres)"
    )
