"""A viewer of another process of the user: `connect_viewer`."""

from __future__ import annotations

import functools
import inspect
import json
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, Concatenate, ParamSpec, TypeVar

import numpy as np

from iprt.errors import IprtError
from iprt.settings.model import Settings
from iprt.settings.overrides import plain_values
from iprt.viewer.program.control import Control
from iprt.viewer.program.listener import HOST
from iprt.viewer.program.running import Running, choose

Given = ParamSpec("Given")
Result = TypeVar("Result")
CONNECTING_S = 10.0
PATHS = {"mesh", "file"}
"""Parameters that are paths."""


def connect_viewer(port: int | None = None) -> RemoteViewer:
    """Return a running viewer that `iprt view` opened, by default the newest.

    Parameters
    ----------
    port : int, optional
        Port of its browsers, or the one that `iprt remote status` prints.

    Raises
    ------
    IprtError
        There is no such viewer.
    """
    return RemoteViewer(choose(port))


def _forwarded(
    method: Callable[Concatenate[Control, Given], Result],
) -> Callable[Concatenate[RemoteViewer, Given], Result]:
    """Return a method of `Control` that asks another process."""
    signature = inspect.signature(method)

    @functools.wraps(method)
    def ask(viewer: RemoteViewer, /, *args: Given.args, **kwargs: Given.kwargs) -> Result:
        try:
            bound = signature.bind(None, *args, **kwargs)
        except TypeError as error:
            raise IprtError(f"{method.__name__}: {error}") from None
        for name in PATHS & bound.arguments.keys():
            given = bound.arguments[name]
            if isinstance(given, str | Path):  # the viewer may have another current folder
                bound.arguments[name] = Path(given).absolute()
        answer: Result = viewer._ask(method.__name__, bound.args[1:], bound.kwargs)
        return answer

    return ask


class RemoteViewer:
    """A viewer of another process, with the methods of `Control`.

    Parameters
    ----------
    viewer : Running
    """

    def __init__(self, viewer: Running) -> None:
        self._viewer = viewer

    def __repr__(self) -> str:
        return f"<viewer of {self._viewer}>"

    def _ask(self, name: str, positional: tuple[Any, ...], named: dict[str, Any]) -> Any:
        """Call a method in the other process, and return its result."""
        request = {
            "token": self._viewer.token,
            "do": name,
            "arguments": positional,
            "named": named,
        }
        try:
            line = json.dumps(request, default=_plain).encode() + b"\n"
        except (TypeError, ValueError) as error:
            raise IprtError(f"{name}: {error}") from None
        gone = IprtError(f"the viewer of {self._viewer} has ended")
        try:
            with socket.create_connection((HOST, self._viewer.port), CONNECTING_S) as connection:
                connection.settimeout(None)  # the method itself has a limit
                connection.sendall(line)
                with connection.makefile("rb") as file:
                    return _result(file)
        except (OSError, ValueError, EOFError) as error:
            raise gone from error

    status = _forwarded(Control.status)
    quit = _forwarded(Control.quit)
    look = _forwarded(Control.look)
    display = _forwarded(Control.display)
    add = _forwarded(Control.add)
    place = _forwarded(Control.place)
    paint = _forwarded(Control.paint)
    remove = _forwarded(Control.remove)
    show = _forwarded(Control.show)
    undo = _forwarded(Control.undo)
    redo = _forwarded(Control.redo)
    save = _forwarded(Control.save)
    restore = _forwarded(Control.restore)
    discard = _forwarded(Control.discard)
    play = _forwarded(Control.play)
    pause = _forwarded(Control.pause)
    seek = _forwarded(Control.seek)
    set = _forwarded(Control.set)
    picture = _forwarded(Control.picture)
    render = _forwarded(Control.render)


def _plain(value: Any) -> Any:
    """Return an argument as plain data, for JSON."""
    if isinstance(value, Settings):
        return plain_values(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} cannot be sent to another process")


def _result(file: BinaryIO) -> Any:
    """Read an answer.

    Raises
    ------
    IprtError
        The answer is an error.
    ValueError, EOFError
        The answer is not complete.
    """
    answer = json.loads(file.readline())
    if "error" in answer:
        lines = answer["error"]
        error = IprtError("\n".join(lines), several_lines=len(lines) > 1)
        error.exit_code = answer["exit_code"]
        raise error
    if "shape" not in answer:
        return answer["result"]
    shape = answer["shape"]
    size = 4 * int(np.prod(shape))
    pixels = file.read(size)
    if len(pixels) < size:
        raise EOFError
    return np.frombuffer(pixels, "<f4").reshape(shape).copy()
