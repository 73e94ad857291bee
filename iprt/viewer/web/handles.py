"""Reading and writing of viser's handles."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Post = Callable[[object, Callable[[], object]], None]
"""Schedules a call on the window's thread; of calls with the same key, only the newest runs."""


def show(handle: Any, name: str, value: Any) -> None:
    """Set an attribute of a handle if it differs, because every assignment is sent."""
    if getattr(handle, name) != value:
        setattr(handle, name, value)


def do_on(listen: Callable[[Any], object], post: Post, do: Callable[[], object]) -> None:
    """Run a function on the window's thread for each click of a button or key of a command."""

    async def happened(_event: Any) -> None:
        post(object(), do)  # none may be merged

    listen(happened)
