"""Where the frames of a video go, one at a time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from iprt.renderer import RenderedFrame


class FrameOutput(ABC):
    """A video as files, of which some frames may be there already.

    Parameters
    ----------
    frames : range
        Numbers of all frames.
    missing : iterable of int
        Those that are still to be rendered, in order.
    """

    def __init__(self, frames: range, missing: Iterable[int]) -> None:
        self.frames = frames
        self._missing = list(missing)

    @property
    def done(self) -> int:
        """How many frames are there."""
        return len(self.frames) - len(self._missing)

    def missing(self) -> Sequence[int]:
        """Numbers of the frames that are still to be rendered, in order."""
        return tuple(self._missing)

    def write(self, index: int, picture: RenderedFrame, device: str) -> None:
        """Keep a frame that the device of that name has rendered.

        Raises
        ------
        FormatError
            It cannot be written.
        """
        self._keep(index, picture, device)
        self._missing.remove(index)

    @abstractmethod
    def _keep(self, index: int, picture: RenderedFrame, device: str) -> None:
        """Write a frame so that nothing loses it."""

    @abstractmethod
    def finish(self) -> None:
        """All frames are there: make of them what was asked for.

        Raises
        ------
        FormatError
            It cannot be written, or a part is damaged.
        """
