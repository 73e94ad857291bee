"""The windows of a viewer, as programs control them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Self, TypeVar

from iprt.geometry.camera import View
from iprt.viewer.lens import Lens
from iprt.viewer.ui_state import UiState
from iprt.viewer.viewport import Viewport


@dataclass(frozen=True)
class Start:
    """The initial state of windows.

    Attributes
    ----------
    view : View
        Initial view; browsers have their own sizes.
    objects : tuple of str or None
        Names of the shown objects; None for all.
    target_fps : float or None
        See `Viewport`.
    lens : Lens
    """

    view: View
    objects: tuple[str, ...] | None = None
    target_fps: float | None = None
    lens: Lens = field(default_factory=Lens)

    @classmethod
    def of(cls, viewport: Viewport) -> Self:
        """Return the present state of a window."""
        fps = viewport.motion.target_fps
        return cls(viewport.view, viewport.objects, fps, viewport.lens)


class Windows(ABC):
    """The windows of one engine; all methods are thread-safe.

    Attributes
    ----------
    port : int or None
        Port of browsers; None for a desktop window.
    """

    port: int | None = None

    @property
    @abstractmethod
    def start(self) -> Start:
        """The state in which later windows begin."""

    @abstractmethod
    def begin(self, start: Start) -> None:
        """Let later windows begin in this state."""

    @property
    @abstractmethod
    def states(self) -> Sequence[UiState]:
        """The states of the open windows, oldest first; only their `post` is thread-safe."""

    @property
    def seen(self) -> Start:
        """The state of the newest window that has a picture, or else `start`."""
        seen = (ui for ui in reversed(self.states) if ui.displayed is not None)
        newest = next(seen, None)
        return self.start if newest is None else Start.of(newest.viewport)

    @abstractmethod
    def leave(self) -> None:
        """Close all windows soon, and discard unsaved edits."""


Some = TypeVar("Some", bound=Windows)
While = Callable[[Some], AbstractContextManager[object]]
"""Returns a context for the time in which windows are open."""
