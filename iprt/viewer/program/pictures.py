"""Pictures at rest, for programs."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing

from iprt.errors import IprtError
from iprt.viewer.client import Client
from iprt.viewer.engine import Engine
from iprt.viewer.session import Shown
from iprt.viewer.state import Request

POLL_S = 0.02
"""Interval in seconds at which events without a signal are awaited."""


def wait_until(engine: Engine, done: Callable[[], bool], until_s: float, what: str) -> None:
    """Wait for something that the engine does, until a time of `time.monotonic`.

    Raises
    ------
    IprtError
        It took longer, or the viewer was closed.
    """
    while not done():
        if engine.closed:
            raise IprtError(f"{what}: the viewer was closed")
        if time.monotonic() > until_s:
            raise IprtError(f"{what}: not finished in time; the viewer is {engine.status.text}")
        time.sleep(POLL_S)


def wait_ready(engine: Engine, until_s: float) -> None:
    """Wait until the frame is known, and the objects have all edits.

    Raises
    ------
    IprtError
        As `wait_until`, or the frame or an object cannot be read.
    """

    def ready() -> bool:
        if problem := engine.problem:
            raise IprtError(problem)
        return engine.ready

    wait_until(engine, ready, until_s, "the scene")


def picture_at_rest(engine: Engine, request: Request, timeout_s: float) -> Shown:
    """Render a picture of the scene with all edits until it is refined.

    Raises
    ------
    IprtError
        The video plays, the picture cannot be rendered, it took longer than `timeout_s`, or the
        viewer was closed.
    """
    if engine.playback.playing:
        raise IprtError("the video plays; pause it before asking for a picture")
    until_s = time.monotonic() + timeout_s
    while True:
        wait_ready(engine, until_s)
        wait_until(engine, lambda: not engine.loading, until_s, "the picture")
        # A client of its own: its picture does not begin with earlier frames.
        with closing(engine.client(request)) as client:
            shown = _refined(engine, client, until_s)
        if engine.ready and not engine.loading:
            return shown


def _refined(engine: Engine, client: Client, until_s: float) -> Shown:
    """Wait for a client's refined picture."""
    found: list[Shown] = []

    def refined() -> bool:
        if problem := client.problem:
            raise IprtError(problem)
        shown = client.shown
        if shown is not None and shown.refined and not shown.plain:
            found.append(shown)
        return bool(found)

    wait_until(engine, refined, until_s, "the picture")
    return found[0]
