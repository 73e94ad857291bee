"""A client of an engine, which gets pictures of its own."""

from __future__ import annotations

from iprt.viewer.core import Core
from iprt.viewer.session import Shown
from iprt.viewer.shared_state import SharedState
from iprt.viewer.state import Request


class Client:
    """A client with its own view; all methods are thread-safe."""

    def __init__(self, shared: SharedState, core: Core, request: Request) -> None:
        self._shared, self._core = shared, core
        self._number = shared.join(request)

    def ask(self, request: Request) -> int:
        """Replace the client's request.

        Returns
        -------
        int
            Number that `Shown.number` reaches with the first picture that answers it.
        """
        return self._shared.ask(self._number, request)

    @property
    def shown(self) -> Shown | None:
        """The newest picture, or None before the first."""
        return self._shared.shown(self._number)

    def wait(self, number: int, timeout_s: float) -> Shown | None:
        """Wait for a picture that answers `number`; None after the timeout."""
        return self._shared.wait(self._number, lambda s: s.number >= number, timeout_s)

    @property
    def problem(self) -> str | None:
        """The reason why no picture answers the request; None if there is none."""
        return self._core.problem_of(self._number)

    def close(self) -> None:
        """Disconnect from the engine."""
        self._shared.leave(self._number)
