"""The room of `scenes360.room` without its tables, and a toy train that rolls over the rug."""

from __future__ import annotations

from functools import cache
from typing import Any

from iprt.truth.shapes import mitsuba_mesh
from scenes360.room import seating, shell, storage
from scenes360.room.plan import Pieces
from scenes360.train import toys


def build(time_s: float = 0.0) -> dict[str, Any]:
    """Return all parts of the room at a time in seconds, without the inserted objects."""
    moving = [mitsuba_mesh(solid, bsdf) for solid, bsdf in toys.train(time_s)]
    return {**_room(), **{f"train{i:02d}": part for i, part in enumerate(moving)}}


@cache
def _room() -> dict[str, Any]:
    """Return the static parts."""
    pieces: Pieces = [
        *shell.shell(),
        *shell.window(),
        *seating.sofa(),
        *storage.bookshelf(),
        *storage.desk(),
        *storage.sideboard(),
        *shell.pictures(),
        *storage.plant(),
        *seating.lamp_body(),
        *toys.track(),
    ]
    parts = {f"part{i:03d}": mitsuba_mesh(solid, bsdf) for i, (solid, bsdf) in enumerate(pieces)}
    parts.update(shell.lights())
    return parts
