"""The picture under way, and whether anybody still wants it."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property

from iprt.viewer.canvas import Stage
from iprt.viewer.mailbox import Asked, Wanted
from iprt.viewer.state import Request, World

ABANDON_S = 0.25
"""A picture under way for less is finished, whatever is wanted."""


@dataclass(frozen=True, eq=False)
class Work:
    """The picture being rendered.

    Attributes
    ----------
    client : int
        For whom.
    stage : Stage
    asked : Asked
    world : World
    begin_s : float
        By `time.perf_counter`.
    """

    client: int
    stage: Stage
    asked: Asked
    world: World
    begin_s: float

    def unwanted(self, wanted: Wanted, abandoned: int) -> bool:
        """Its renderer cannot go on to what is wanted now, and it takes long.

        One that only has to turn, or to follow a video or an object, is finished: or else who
        drags the camera would see nothing.

        Parameters
        ----------
        wanted : Wanted
        abandoned : int
            Pictures before this one, none of which was finished. Each gets twice the time of the
            one before, so that one is finished while a slider is dragged.
        """
        if time.perf_counter() - self.begin_s < ABANDON_S * 2**abandoned:
            return False
        asked = wanted.requests.get(self.client)
        return asked is None or _needs(wanted.world, asked.request) != self._needs

    @cached_property
    def _needs(self) -> tuple[object, ...]:
        return _needs(self.world, self.asked.request)


def _needs(world: World, request: Request) -> tuple[object, ...]:
    """Everything that requires another renderer when it changes."""
    view = request.view
    made = [(edit.material, edit.removed, edit.path) for edit in world.edits]
    return (
        (view.width, view.height, view.projection),
        request.settings or world.settings,
        request.objects,
        [(e.name, how) for e, how in zip(world.edits, made, strict=True) if any(how)],
    )
