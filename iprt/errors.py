"""Errors that a user can cause. Messages name the fault, its place, and the remedy."""

from __future__ import annotations


class IprtError(Exception):
    """An error that the user can act on; the command line prints it without a traceback.

    Attributes
    ----------
    exit_code : int
        Exit status of the process: 2 for bad input, 3 for a missing device.
    several_lines : bool
        True if line feeds separate lines of the message. Otherwise the message is one line, and a
        line feed is part of a name.
    """

    exit_code = 2

    def __init__(self, message: str, *, several_lines: bool = False) -> None:
        super().__init__(message)
        self.several_lines = several_lines

    @property
    def lines(self) -> list[str]:
        """The message by lines."""
        return str(self).split("\n") if self.several_lines else [str(self)]


class SceneError(IprtError):
    """An invalid scene folder or manifest."""


class FormatError(IprtError):
    """An input file that cannot be read, or an output that cannot be written."""


class OutputError(IprtError):
    """A failure to write to standard output."""


class DeviceError(IprtError):
    """A missing or ambiguous OpenCL device, or no OpenGL context through EGL."""

    exit_code = 3


class DeviceLostError(DeviceError):
    """The loss of a context or queue by the driver; a new context may work."""


class DeviceHangError(DeviceError):
    """A device that did not answer in time; everything that waits for it may hang too."""


class KernelError(IprtError):
    """A failed build of an OpenCL program; the message holds the whole build log."""

    exit_code = 3

    def __init__(self, message: str) -> None:
        super().__init__(message, several_lines=True)
