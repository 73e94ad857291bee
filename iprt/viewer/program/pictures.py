"""Pictures at rest, for programs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from iprt.errors import IprtError
from iprt.viewer.engine import Client, Engine
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
    """Wait until the first frame and the objects are known.

    Raises
    ------
    IprtError
        As `wait_until`, or the frame or an object cannot be read.
    """

    def ready() -> bool:
        if problem := engine.problem:
            raise IprtError(problem)
        return engine.ready

    wait_until(engine, ready, until_s, "opening the scene")


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
    wait_ready(engine, until_s)
    with _client(engine, request) as client:
        while True:
            wait_until(engine, lambda: not engine.loading, until_s, "the picture")
            # Earlier pictures may lack what has been loaded.
            shown = _refined(engine, client, client.ask(request), until_s)
            if not engine.loading:
                return shown


def _refined(engine: Engine, client: Client, number: int, until_s: float) -> Shown:
    """Wait for the refined picture that answers a number."""

    def newest() -> Shown | None:
        if problem := client.problem:
            raise IprtError(problem)
        shown, frame = client.shown, engine.playback.frame
        if shown is None or shown.number < number or not shown.refined:
            return None
        return shown if shown.frame == frame else None  # else it is still being decoded

    wait_until(engine, lambda: newest() is not None, until_s, "the picture")
    shown = newest()
    assert shown is not None
    return shown


@contextmanager
def _client(engine: Engine, request: Request) -> Iterator[Client]:
    client = engine.client(request)
    try:
        yield client
    finally:
        client.close()
