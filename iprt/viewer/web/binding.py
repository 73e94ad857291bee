"""Two-way bindings between inputs of a panel and values of the engine."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from iprt.errors import IprtError

Post = Callable[[object, Callable[[], object]], None]
"""Schedules a call on the window's thread; of calls with the same key, only the newest runs."""

HELD_S = 0.4
"""Seconds for which an input is not updated after its user has changed it."""


class Binding:
    """A two-way binding of one input: the user's changes are written, other changes are shown.

    Parameters
    ----------
    handle : viser handle with a value
    read : callable
        Returns the current value, in the handle's type.
    write : callable
        Takes the handle's value; after an IprtError the input is reset.
    post : Post
    report : callable
        Takes a line for the user.
    """

    def __init__(
        self,
        handle: Any,
        read: Callable[[], Any],
        write: Callable[[Any], object],
        post: Post,
        report: Callable[[str], None],
    ) -> None:
        self.handle, self._read, self._write, self._report = handle, read, write, report
        self._touched_s = -HELD_S
        self._seen = read()
        self._show(self._seen)

        # This must be a coroutine: viser would call a plain function on another thread, after
        # `show`.
        async def changed(event: Any) -> None:
            if event.client_id is not None:  # else the change is our own
                self._touched_s = time.monotonic()
                post(self, self._written)

        handle.on_update(changed)

    @property
    def touched(self) -> bool:
        """True if the user changed it recently and may still hold it."""
        return time.monotonic() - self._touched_s < 2.0 * HELD_S

    def sync(self) -> None:
        """Show changes by others, unless the user is changing the input."""
        if time.monotonic() - self._touched_s < HELD_S:
            return
        now = self._read()
        if now != self._seen:
            self._seen = now
            self._show(now)

    def _written(self) -> None:
        value = self.handle.value
        try:
            self._write(value)
        except IprtError as error:
            self._report(str(error))
            self._touched_s = -HELD_S
        self._seen = value

    def _show(self, value: Any) -> None:
        show(self.handle, "value", value)


def show(handle: Any, name: str, value: Any) -> None:
    """Set an attribute of a handle if it differs, because every assignment is sent."""
    if getattr(handle, name) != value:
        setattr(handle, name, value)


def do_on(listen: Callable[[Any], object], post: Post, do: Callable[[], object]) -> None:
    """Run a function on the window's thread for each click of a button or key of a command."""

    async def happened(_event: Any) -> None:
        post(object(), do)  # none may be merged

    listen(happened)
