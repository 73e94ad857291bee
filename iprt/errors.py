"""The errors a user can cause. Each message says what, where, what is expected, what to do."""

from __future__ import annotations


class IprtError(Exception):
    """A problem the user can act on. The command line prints it without a traceback.

    Attributes
    ----------
    exit_code : int
        Process exit status when the error reaches the command line: 2 bad input, 3 no device.
    several_lines : bool
        Whether line feeds end lines of the message. Otherwise it is one line, and a line feed is
        part of a name.
    """

    exit_code = 2

    def __init__(self, message: str, *, several_lines: bool = False) -> None:
        super().__init__(message)
        self.several_lines = several_lines

    @property
    def lines(self) -> list[str]:
        return str(self).split("\n") if self.several_lines else [str(self)]


class SceneError(IprtError):
    """A scene folder or its manifest does not hold what the format asks for."""


class FormatError(IprtError):
    """A file cannot be read as what it should be, or an output cannot be written."""


class OutputError(IprtError):
    """Standard output cannot be written."""


class DeviceError(IprtError):
    """No usable OpenCL device, an ambiguous choice of one, or no OpenGL context through EGL."""

    exit_code = 3


class DeviceLostError(DeviceError):
    """The driver has given up a context or queue; a new context may work."""


class DeviceHangError(DeviceError):
    """A device did not answer in time. Whatever waits for it, its driver included, may hang too."""


class KernelError(IprtError):
    """An OpenCL program did not build; the message, of several lines, is the whole report."""

    exit_code = 3

    def __init__(self, message: str) -> None:
        super().__init__(message, several_lines=True)
