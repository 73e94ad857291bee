"""Tracks of picture files, one picture per frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Generic, TypeVar

from iprt.errors import FormatError
from iprt.files.images import Header, read_depth, read_header
from iprt.files.kinds import FRAME_PATTERN, file_kind
from iprt.files.safe_reading import is_file, require_inside
from iprt.footage.video.depth_code import DepthCode, DepthSamples, unit_problem
from iprt.footage.video.reader import Streams

Item = TypeVar("Item")
LOSSY = ("jpeg", "webp", "avif")
"""Kinds of pictures with lossy compression."""


def frame_path(root: Path, pattern: str, index: int) -> Path:
    """Return the file of frame `index` for a printf pattern."""
    return root / FRAME_PATTERN.sub(lambda match: match[0] % index, pattern)


class PictureTrack(Generic[Item]):
    """One picture for all frames, or one per frame by a printf pattern.

    Parameters
    ----------
    key, pattern : str
        Key and value in `[video]`.
    root : Path
        The scene's folder.
    indices : range
        Indices of the frames.
    within : Path
        Folder that must contain all files, after resolving links.
    read : callable
        Reads a picture from a path.
    layer : str or None
        Layer of EXR files; see `read_header`.
    """

    def __init__(
        self,
        key: str,
        pattern: str,
        root: Path,
        indices: range,
        within: Path,
        read: Callable[[Path], Item],
        layer: str | None = None,
    ) -> None:
        self.key, self._root, self._pattern = key, root, pattern
        self._within, self._read, self._layer = within, read, layer
        self._indices = indices if FRAME_PATTERN.search(pattern) else indices[:1]

    def file(self, index: int) -> Path:
        """Return the file of a frame."""
        return frame_path(self._root, self._pattern, index)

    def _files(self) -> Iterator[Path]:
        return (self.file(index) for index in self._indices)

    def missing(self) -> Iterator[Path]:
        """Iterate over missing files, in the order of frames."""
        return (file for file in self._files() if not is_file(file))

    def problems(self) -> list[str]:
        """Return a line if files lie outside the allowed folder."""
        folders: set[Path] = set()
        try:
            for file in self._files():
                if file.parent not in folders or file.is_symlink():
                    require_inside(file, self._within)
                    folders.add(file.parent)
        except FormatError as error:
            return [f"video.{self.key}: {error}"]
        return []

    def header(self) -> Header:
        """Read the header of the first picture."""
        return read_header(self.file(self._indices[0]), self._layer)

    def reader(self, _: Streams) -> Callable[[int], Item]:
        """Return a function that reads the picture of a frame."""
        # A single picture for all frames is read once.
        read = self._read if FRAME_PATTERN.search(self._pattern) else cache(self._read)
        return lambda index: read(self.file(index))


class DepthPictures(PictureTrack[DepthSamples]):
    """Track of depth pictures, as stored; `code` is required for integers."""

    def __init__(
        self,
        pattern: str,
        root: Path,
        indices: range,
        within: Path,
        layer: str | None,
        code: DepthCode,
    ) -> None:
        super().__init__("depth", pattern, root, indices, within, self._samples, layer)
        self._code = code

    def problems(self) -> list[str]:
        """Return lines on files outside the allowed folder, or depth without a unit."""
        problems = super().problems()
        if not self._code.is_known and not problems:
            first = self.file(self._indices[0])
            try:
                if file_kind(first) in ("png", *LOSSY):
                    problems.append(unit_problem(first.name))
            except FormatError as error:
                problems.append(f"video.{self.key}: {error}")
        return problems

    def _samples(self, path: Path) -> DepthSamples:
        depth, bits = read_depth(path, self._layer)
        if bits and not self._code.is_known:
            raise FormatError(f"{path}: {unit_problem(path.name)}")
        white = 2.0**bits - 1.0 if bits else 1.0
        return DepthSamples(depth, 0.0, white, bits, exact=file_kind(path) not in LOSSY)
