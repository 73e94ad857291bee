"""Between the engine's thread and all others: what is asked for, and what came of it.

Of each kind only the newest is kept, so that nothing can pile up.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from iprt.scene.edits import ObjectEdit
from iprt.viewer.history import History
from iprt.viewer.session import Shown
from iprt.viewer.state import Playback, Request, Status, World


@dataclass(frozen=True)
class Asked:
    """A request, and the number under which it was asked."""

    number: int
    request: Request


@dataclass(frozen=True)
class Wanted:
    """All that is wanted at one moment.

    Attributes
    ----------
    number : int
        Number of the newest change to the world.
    world : World
    requests : dict of int to Asked
        By client.
    """

    number: int
    world: World
    requests: dict[int, Asked]


class Mailbox:
    """Requests to the engine, and its pictures. Any thread may call any method."""

    def __init__(self, world: World, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._history = History()
        self._condition = threading.Condition()
        self._number = 0
        self._clients = 0
        self._world, self._world_number = world, 0
        self._requests: dict[int, Asked] = {}
        self._shown: dict[int, Shown] = {}
        self._status = Status()
        self._stirred = False
        self._closed = False

    # Clients call these -----------------------------------------------------------------------

    def join(self, request: Request) -> int:
        """A new client's number."""
        with self._condition:
            self._clients += 1
            client = self._clients
        self.ask(client, request)
        return client

    def leave(self, client: int) -> None:
        with self._condition:
            self._requests.pop(client, None)
            self._shown.pop(client, None)
            self._stir()

    def ask(self, client: int, request: Request) -> int:
        """Want another picture in place of what was asked for before; the number of this."""
        with self._condition:
            self._number += 1
            self._requests[client] = Asked(self._number, request)
            self._stir()
            return self._number

    def change(self, change: Callable[[World], World]) -> int:
        """Change the world that all see; the number of this.

        Where nothing changes, that of the last change."""
        with self._condition:
            world = change(self._world)
            if world != self._world:
                self._number += 1
                self._world, self._world_number = world, self._number
                self._stir()
            return self._world_number

    def play_as(self, before: Playback, after: Playback) -> int:
        """Play on otherwise, if nobody has asked for something else since; the number of this."""
        return self.change(
            lambda world: replace(world, playback=after) if world.playback == before else world
        )

    def edit(self, name: str, edit: Callable[[ObjectEdit], ObjectEdit]) -> int:
        """Change the edit of an object, in a way that can be undone; the number of this."""

        def change(world: World) -> World:
            after = world.edited(edit(world.edit_of(name)))
            if after != world:
                self._history.add(world.edits, after.edits, self._clock())
            return after

        return self.change(change)

    def undo(self) -> int:
        """Take the last change of edits back; the number of this."""
        return self.change(lambda world: replace(world, edits=self._history.undo(world.edits)))

    def redo(self) -> int:
        """Make again what was undone last; the number of this."""
        return self.change(lambda world: replace(world, edits=self._history.redo(world.edits)))

    @property
    def can_undo(self) -> bool:
        with self._condition:
            return self._history.can_undo

    @property
    def can_redo(self) -> bool:
        with self._condition:
            return self._history.can_redo

    def saved(self, edits: tuple[ObjectEdit, ...]) -> int:
        """The scene's files have these now; the number of this."""
        return self.change(lambda world: replace(world, saved=edits))

    def reread(self) -> int:
        """The scene's files are what edits differ from now; the number of this.

        Nothing that was saved before can be undone then: only others know what was there before.
        """

        def change(world: World) -> World:
            if not world.saved:
                return world
            self._history.clear()
            edits = tuple(edit for edit in world.edits if edit not in world.saved)
            return replace(world, edits=edits, saved=())

        return self.change(change)

    @property
    def world(self) -> World:
        with self._condition:
            return self._world

    @property
    def status(self) -> Status:
        with self._condition:
            return self._status

    def shown(self, client: int) -> Shown | None:
        """The newest picture of a client; None: there is none yet."""
        with self._condition:
            return self._shown.get(client)

    def wait(self, client: int, ready: Callable[[Shown], bool], timeout_s: float) -> Shown | None:
        """The first picture of a client that is `ready`; None: there was none in so many seconds,
        or the engine was closed.
        """

        def found() -> Shown | None:
            shown = self._shown.get(client)
            return shown if shown is not None and ready(shown) else None

        with self._condition:
            self._condition.wait_for(lambda: self._closed or found() is not None, timeout_s)
            return found()

    # The engine calls these -------------------------------------------------------------------

    def take(self) -> Wanted:
        """The newest requests, which count as seen."""
        with self._condition:
            self._stirred = False
            return self.wanted

    @property
    def wanted(self) -> Wanted:
        with self._condition:
            return Wanted(self._world_number, self._world, dict(self._requests))

    def publish(self, client: int, shown: Shown) -> None:
        with self._condition:
            if client in self._requests:
                self._shown[client] = shown
                self._condition.notify_all()

    def report(self, status: Status) -> None:
        with self._condition:
            if status != self._status:
                self._status = status
                self._condition.notify_all()

    def stir(self) -> None:
        """Let the engine look what there is to do."""
        with self._condition:
            self._stir()

    def rest(self, timeout_s: float) -> None:
        """Until something is asked for, or so many seconds."""
        with self._condition:
            self._condition.wait_for(lambda: self._stirred or self._closed, timeout_s)

    def close(self) -> None:
        with self._condition:
            self._closed = True
            self._condition.notify_all()

    @property
    def closed(self) -> bool:
        with self._condition:
            return self._closed

    def _stir(self) -> None:
        self._stirred = True
        self._condition.notify_all()
