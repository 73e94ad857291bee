"""How far compilers are."""

from __future__ import annotations

from collections.abc import Callable


class Compiling:
    """Counts programs that are built and kernels that are launched first: drivers compile at both.

    Parameters
    ----------
    report : callable
        Called whenever something changes.

    Attributes
    ----------
    file : str or None
        File of `cl/` that is compiled now. None: nothing is.
    built, to_build : int
        Parts that were begun, and all that there are.
    """

    def __init__(self, report: Callable[[], None]) -> None:
        self._report = report
        self.file: str | None = None
        self.built = self.to_build = 0

    def expect(self, parts: int) -> None:
        """So many will be compiled; more may come."""
        self.built, self.to_build = 0, parts

    def begin(self, file: str) -> None:
        """The next part is compiled."""
        self.file = file
        self.built += 1
        self.to_build = max(self.to_build, self.built)
        self._report()

    def pause(self) -> None:
        """The device renders, as far as it can."""
        self.file = None
        self._report()

    def finish(self) -> None:
        """All is there. Kernels that were expected and not needed now count as built."""
        if self.file is not None and self.built < self.to_build:
            self.built = self.to_build
            self._report()
        self.file = None
        self.built = self.to_build = 0
        self._report()
