"""The picture under way, and detection of obsolete ones."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property

from iprt.viewer.accumulating_renderer import Stage
from iprt.viewer.shared_state import NumberedRequest, Snapshot
from iprt.viewer.state import Request, World

ABANDON_S = 0.25
"""Seconds below which a picture under way is always finished."""


@dataclass(frozen=True, eq=False)
class PictureJob:
    """The picture being rendered.

    Attributes
    ----------
    client : int
        Client that it is rendered for.
    stage : Stage
    asked : NumberedRequest
    world : World
    begin_s : float
        Start time by `time.perf_counter`.
    """

    client: int
    stage: Stage
    asked: NumberedRequest
    world: World
    begin_s: float

    def unwanted(self, wanted: Snapshot, abandoned: int) -> bool:
        """Return True if the picture is obsolete and has taken long.

        It is obsolete if its renderer cannot follow to the current request. A renderer that only
        has to turn, or to follow a video or an object, finishes its picture. Otherwise the user
        would see nothing during a drag of the camera.

        Parameters
        ----------
        wanted : Snapshot
        abandoned : int
            Number of consecutive abandoned pictures before this one. Each gets twice the time of
            the one before, so that one is finished during the drag of a slider.
        """
        if time.perf_counter() - self.begin_s < ABANDON_S * 2**abandoned:
            return False
        asked = wanted.requests.get(self.client)
        return asked is None or _needs(wanted.world, asked.request) != self._needs

    @cached_property
    def _needs(self) -> tuple[object, ...]:
        return _needs(self.world, self.asked.request)


def _needs(world: World, request: Request) -> tuple[object, ...]:
    """Return the values that require another renderer when they change."""
    view = request.view
    made = [(e.material, e.removed, e.path, e.light is not None) for e in world.edits]
    return (
        (view.width, view.height, view.projection),
        request.settings or world.settings,
        request.objects,
        [(e.name, how) for e, how in zip(world.edits, made, strict=True) if any(how)],
        (world.light.gloss, world.light.sun == "none"),
    )
