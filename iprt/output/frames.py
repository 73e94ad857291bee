"""Destinations of the frames of a video, written one at a time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from iprt.renderer import RenderedFrame


class FrameOutput(ABC):
    """Video as files, of which some frames may exist already.

    Parameters
    ----------
    frames : range
        Numbers of all frames.
    missing : iterable of int
        Numbers of frames still to render, in order.
    """

    def __init__(self, frames: range, missing: Iterable[int]) -> None:
        self.frames = frames
        self._missing = list(missing)

    @property
    def done(self) -> int:
        """Number of finished frames."""
        return len(self.frames) - len(self._missing)

    def missing(self) -> Sequence[int]:
        """Numbers of the frames still to render, in order."""
        return tuple(self._missing)

    def write(self, index: int, picture: RenderedFrame, device: str) -> None:
        """Keep a frame rendered by the device of that name.

        Raises
        ------
        FormatError
            It cannot be written.
        """
        self._keep(index, picture, device)
        self._missing.remove(index)

    @abstractmethod
    def _keep(self, index: int, picture: RenderedFrame, device: str) -> None:
        """Write a frame durably."""

    @abstractmethod
    def finish(self) -> None:
        """Complete the output, once all frames are written.

        Raises
        ------
        FormatError
            It cannot be written, or a part is damaged.
        """
