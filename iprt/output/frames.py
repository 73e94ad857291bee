"""Frames of a video, written one at a time: the base of outputs, and numbered pictures."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from iprt.errors import FormatError
from iprt.files.kinds import FRAME_PATTERN
from iprt.output.encode import FORMATS
from iprt.output.metadata import difference
from iprt.output.picture import write_picture

if TYPE_CHECKING:
    from iprt.renderer import RenderedFrame

LEFT_BEHIND = re.compile(r"\.[0-9a-f]{32}\.tmp")
"""Names of files that `replacing` could not remove, because its process was killed."""
PNG_END = bytes.fromhex("00000000 49454e44 ae426082")
"""The last chunk of every PNG file."""

Metadata = Mapping[str, str]


class FrameOutput(ABC):
    """Frames of a video as files. A frame is written once, by any of several processes."""

    @abstractmethod
    def has(self, index: int) -> bool:
        """Return whether a frame is written.

        Raises
        ------
        FormatError
            Something else is in its place.
        """

    @abstractmethod
    def write(self, index: int, picture: RenderedFrame, metadata: Metadata) -> None:
        """Keep a frame durably.

        Raises
        ------
        FormatError
            It cannot be written.
        """

    @abstractmethod
    def clean(self) -> None:
        """Remove what killed processes left. No other process may write meanwhile."""

    @abstractmethod
    def finish(self) -> None:
        """Complete the output, once all frames are written.

        Raises
        ------
        FormatError
            It cannot be written, or a part is damaged.
        """


def is_pattern(path: Path) -> bool:
    """Return whether the file's name has a place for a number."""
    return FRAME_PATTERN.search(path.name) is not None


def is_video(path: Path) -> bool:
    """Return whether a path can hold several frames: numbered pictures, or a video file."""
    return is_pattern(path) or path.suffix.lower() in FORMATS


def numbered(pattern: Path, index: int) -> Path:
    """Return the file of a frame.

    Raises
    ------
    FormatError
        There is more than one place for the number.
    """
    if "%" in FRAME_PATTERN.sub("", pattern.name, count=1):
        raise FormatError(f"{pattern}: expected one %d or %04d and no other %")
    return pattern.with_name(FRAME_PATTERN.sub(lambda match: match[0] % index, pattern.name))


class PictureSequence(FrameOutput):
    """Frames as separate files.

    Parameters
    ----------
    pattern : Path
    expected : callable
        Returns metadata that a frame must have, by its number.
    exposure : float
        For display-referred formats.
    """

    def __init__(self, pattern: Path, expected: Callable[[int], Metadata], exposure: float) -> None:
        self.pattern = pattern
        self._expected, self._exposure = expected, exposure

    def has(self, index: int) -> bool:
        """Return whether a frame's file is there, and of this render."""
        path = numbered(self.pattern, index)
        if not path.exists():
            return False
        found = read_metadata(path)
        if found is None:
            raise FormatError(
                f"{path}: is damaged or not by iprt; delete it, or name another output"
            )
        expected = self._expected(index)
        differs = difference({key: found[key] for key in expected if key in found}, expected)
        if differs is not None:
            raise FormatError(
                f"{path}: is a frame of another render: {differs}; delete all its frames, or name "
                "another output"
            )
        return True

    def write(self, index: int, picture: RenderedFrame, metadata: Metadata) -> None:
        """Write a frame's file, with its metadata in the header."""
        write_picture(
            numbered(self.pattern, index),
            picture.color,
            aovs=picture.aovs,
            exposure=self._exposure,
            metadata=metadata,
        )

    def clean(self) -> None:
        """Remove temporary files."""
        for path in self.pattern.parent.iterdir():
            if LEFT_BEHIND.fullmatch(path.name):
                path.unlink()

    def finish(self) -> None:
        """Do nothing: every frame is complete by itself."""


def read_metadata(path: Path) -> Metadata | None:
    """Return the metadata of a rendered picture; None if it is incomplete or not ours."""
    read = _read_exr if path.suffix.lower() == ".exr" else _read_png
    try:
        found = {key: value for key, value in read(path).items() if key.startswith("iprt:")}
    except (FormatError, OSError, SyntaxError, ValueError, RuntimeError):
        return None
    return found or None


def _read_exr(path: Path) -> dict[str, str]:
    from iprt.files.exr import exr_size

    exr_size(path)  # raises an error for an incomplete file
    import OpenEXR

    header = OpenEXR.File(str(path), header_only=True).header()
    return {key: value for key, value in header.items() if isinstance(value, str)}


def _read_png(path: Path) -> dict[str, str]:
    from PIL import Image

    with path.open("rb") as file:
        file.seek(-len(PNG_END), 2)
        if file.read() != PNG_END:
            raise FormatError(f"{path}: cut off")
    with Image.open(path, formats=["PNG"]) as image:
        return {str(key): text for key, text in image.info.items() if isinstance(text, str)}
