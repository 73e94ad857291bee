"""Furnished living and work room, wholly procedural, as Mitsuba parts.

World: the scene format's. The floor is at y = -1.5, the capture centre in the room's middle.
"""

from __future__ import annotations

from typing import Any

from iprt.truth.shapes import mitsuba_mesh
from scenes360.room import seating, shell, storage
from scenes360.room.plan import FLOOR_ALPHA, Pieces


def build(floor_alpha: float = FLOOR_ALPHA, detail: int = 1) -> dict[str, Any]:
    """Return all parts of the room, without the inserted objects.

    Parameters
    ----------
    floor_alpha : float
        Roughness of the floor's coat.
    detail : int
        Factor on the resolution of textures; their grain and yarn become finer by it.
    """
    pieces: Pieces = [
        *shell.shell(floor_alpha, detail),
        *shell.window(),
        *seating.sofa(detail),
        *seating.coffee_table(detail),
        *seating.armchair(detail),
        *storage.bookshelf(detail),
        *storage.desk(detail),
        *storage.sideboard(detail),
        *shell.pictures(detail),
        *storage.plant(),
        *seating.lamp_body(),
    ]
    parts = {f"part{i:03d}": mitsuba_mesh(solid, bsdf) for i, (solid, bsdf) in enumerate(pieces)}
    parts.update(shell.lights())
    return parts
