"""Exchange between the engine's thread and all others: requests, pictures and status.

Only the newest of each kind is kept, so that nothing can pile up.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from iprt.scene.light_edits import UNEDITED
from iprt.scene.view_edits import views_besides
from iprt.viewer.history import Edits, History
from iprt.viewer.session import Shown
from iprt.viewer.state import Playback, Request, Status, World


@dataclass(frozen=True)
class NumberedRequest:
    """A request with its number."""

    number: int
    request: Request


@dataclass(frozen=True)
class Snapshot:
    """A snapshot of the world and all requests.

    Attributes
    ----------
    number : int
        Number of the newest change to the world.
    world : World
    requests : dict of int to NumberedRequest
        Requests by client.
    """

    number: int
    world: World
    requests: dict[int, NumberedRequest]


class SharedState:
    """Requests to the engine, and its pictures; all methods are thread-safe.

    Attributes are replaced as a whole, and only read by others.

    Attributes
    ----------
    world : World
        The shared world, as requested.
    history : History
        Undo and redo of its edits.
    status : Status
        The engine's status.
    closed : bool
        True after `close`.
    """

    def __init__(self, world: World, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self.history = History()
        self._condition = threading.Condition()
        self._number = 0
        self._clients = 0
        self.world, self._world_number = world, 0
        self._requests: dict[int, NumberedRequest] = {}
        self._shown: dict[int, Shown] = {}
        self.status = Status()
        self._stirred = False
        self.closed = False

    # Clients call these -----------------------------------------------------------------------

    def join(self, request: Request) -> int:
        """Register a client with its request, and return its number."""
        with self._condition:
            self._clients += 1
            client = self._clients
        self.ask(client, request)
        return client

    def leave(self, client: int) -> None:
        """Remove a client."""
        with self._condition:
            self._requests.pop(client, None)
            self._shown.pop(client, None)
            self._stir()

    def ask(self, client: int, request: Request) -> int:
        """Replace a client's request; return its number."""
        with self._condition:
            self._number += 1
            self._requests[client] = NumberedRequest(self._number, request)
            self._stir()
            return self._number

    def change(self, change: Callable[[World], World]) -> int:
        """Change the shared world; return the number of the change.

        Without an effect, it returns the number of the last change.
        """
        with self._condition:
            world = change(self.world)
            if world != self.world:
                self._number += 1
                self.world, self._world_number = world, self._number
                self._stir()
            return self._world_number

    def play_as(self, before: Playback, after: Playback) -> int:
        """Replace the playback if it is still `before`; return the number of the change."""
        return self.change(
            lambda world: replace(world, playback=after) if world.playback == before else world
        )

    def edit(self, edited: Callable[[World], World], *, alone: bool = False) -> int:
        """Change the edits in the world, with undo; return the number of the change.

        A change that stands `alone` is no part of the gesture before it.
        """

        def change(world: World) -> World:
            after = edited(world)
            if after != world:
                if alone:
                    self.history.end_gesture()
                self.history.add(_edits(world), _edits(after), self._clock())
            return after

        return self.change(change)

    def undo(self) -> int:
        """Undo the last change of the edits; return the number of the change."""
        return self._go(self.history.undo)

    def redo(self) -> int:
        """Redo the last undone change; return the number of the change."""
        return self._go(self.history.redo)

    def _go(self, step: Callable[[Edits], Edits]) -> int:
        def change(world: World) -> World:
            edits = step(_edits(world))
            return replace(world, edits=edits.objects, light=edits.light, views=edits.views)

        return self.change(change)

    def saved(self, written: World) -> int:
        """Record that the files contain the edits of a world; return the number of the change."""
        return self.change(
            lambda world: replace(
                world,
                saved=written.edits,
                saved_light=written.light,
                saved_views=written.views,
            )
        )

    def reread(self) -> int:
        """Make the scene's current files the base of the edits; return the number of the change.

        Edits saved before cannot be undone afterwards, because the files have changed since.
        """

        def change(world: World) -> World:
            if not world.saved and not world.saved_light.parts and not world.saved_views:
                return world
            self.history.clear()
            saved = {edit.name: edit for edit in world.saved}
            rest = (edit.besides(saved.get(edit.name)) for edit in world.edits)
            return replace(
                world,
                edits=tuple(edit for edit in rest if edit is not None),
                light=world.light.besides(world.saved_light),
                views=views_besides(world.views, world.saved_views),
                saved=(),
                saved_light=UNEDITED,
                saved_views=(),
            )

        return self.change(change)

    def shown(self, client: int) -> Shown | None:
        """Return the newest picture of a client, or None before the first."""
        with self._condition:
            return self._shown.get(client)

    def wait(self, client: int, ready: Callable[[Shown], bool], timeout_s: float) -> Shown | None:
        """Wait for a `ready` picture of a client; None after the timeout or closing."""

        def found() -> Shown | None:
            shown = self._shown.get(client)
            return shown if shown is not None and ready(shown) else None

        with self._condition:
            self._condition.wait_for(lambda: self.closed or found() is not None, timeout_s)
            return found()

    # The engine calls these -------------------------------------------------------------------

    def take(self) -> Snapshot:
        """Return the newest requests, and mark them as seen."""
        with self._condition:
            self._stirred = False
            return self.snapshot

    @property
    def snapshot(self) -> Snapshot:
        """The newest requests."""
        with self._condition:
            return Snapshot(self._world_number, self.world, dict(self._requests))

    def publish(self, client: int, shown: Shown) -> None:
        """Publish a picture to a client."""
        with self._condition:
            if client in self._requests:
                self._shown[client] = shown
                self._condition.notify_all()

    def report(self, status: Status) -> None:
        """Publish the engine's status."""
        with self._condition:
            if status != self.status:
                self.status = status
                self._condition.notify_all()

    def stir(self) -> None:
        """Wake the engine."""
        with self._condition:
            self._stir()

    def rest(self, timeout_s: float) -> None:
        """Wait for a request, for at most `timeout_s`."""
        with self._condition:
            self._condition.wait_for(lambda: self._stirred or self.closed, timeout_s)

    def close(self) -> None:
        """Close the shared, and wake all waiting threads."""
        with self._condition:
            self.closed = True
            self._condition.notify_all()

    def _stir(self) -> None:
        self._stirred = True
        self._condition.notify_all()


def _edits(world: World) -> Edits:
    return Edits(world.edits, world.light, world.views)
