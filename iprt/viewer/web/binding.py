"""Inputs of a panel that show what the engine has, and change it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from iprt.errors import IprtError

Post = Callable[[object, Callable[[], object]], None]
"""Have something done by the window's thread; of what has the same key, only the newest."""

HELD_S = 0.4
"""An input is left alone for so long after its user has moved it."""


class Binding:
    """One input: what its user sets is written, what others set is shown.

    Parameters
    ----------
    handle : viser handle with a value
    read : callable
        What is set now, as the handle has it.
    write : callable
        Takes the handle's value; after an IprtError the input goes back.
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

        # A coroutine: viser would call a plain function on another thread, later than `show`.
        async def changed(event: Any) -> None:
            if event.client_id is not None:  # else it was ourselves
                self._touched_s = time.monotonic()
                post(self, self._written)

        handle.on_update(changed)

    @property
    def touched(self) -> bool:
        """The user has set it and may hold it still."""
        return time.monotonic() - self._touched_s < 2.0 * HELD_S

    def sync(self) -> None:
        """Show what others have set, but never under the user's hand."""
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
    """Set what a handle has under a name, if it is not so already: each time is sent."""
    if getattr(handle, name) != value:
        setattr(handle, name, value)


def do_on(listen: Callable[[Any], object], post: Post, do: Callable[[], object]) -> None:
    """Have a button's click or a command's key do something, by the window's thread."""

    async def happened(_event: Any) -> None:
        post(object(), do)  # each one counts

    listen(happened)
