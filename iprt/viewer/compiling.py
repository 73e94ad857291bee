"""Progress of the compilers."""

from __future__ import annotations

from collections.abc import Callable


class Compiling:
    """A count of the kernel parts that drivers compile, at program builds and first launches.

    Parameters
    ----------
    report : callable
        Called after every change.

    Attributes
    ----------
    file : str or None
        File of `cl/` that is being compiled, or None.
    built, to_build : int
        Numbers of started and of all parts.
    """

    def __init__(self, report: Callable[[], None]) -> None:
        self._report = report
        self.file: str | None = None
        self.built = self.to_build = 0

    def expect(self, parts: int) -> None:
        """Reset the counts for this many parts; more may follow."""
        self.built, self.to_build = 0, parts

    def begin(self, file: str) -> None:
        """Record that the next part is being compiled."""
        self.file = file
        self.built += 1
        self.to_build = max(self.to_build, self.built)
        self._report()

    def pause(self) -> None:
        """Record a pause, in which the device renders with the kernels it has."""
        self.file = None
        self._report()

    def finish(self) -> None:
        """Record the end; expected kernels that were not needed count as built."""
        if self.file is not None and self.built < self.to_build:
            self.built = self.to_build
            self._report()
        self.file = None
        self.built = self.to_build = 0
        self._report()
