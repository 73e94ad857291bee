"""A furnished living and work room, wholly procedural, as Mitsuba sees it.

World: the scene format's. The floor is at y = -1.5, the capture centre in the room's middle.
"""

from __future__ import annotations

from typing import Any

from iprt.truth.shapes import mitsuba_mesh
from scenes360.room import seating, shell, storage
from scenes360.room.plan import Pieces


def build() -> dict[str, Any]:
    """All parts of the room, without the inserted objects."""
    pieces: Pieces = [
        *shell.shell(),
        *shell.window(),
        *seating.sofa(),
        *seating.coffee_table(),
        *seating.armchair(),
        *storage.bookshelf(),
        *storage.desk(),
        *storage.sideboard(),
        *shell.pictures(),
        *storage.plant(),
        *seating.lamp_body(),
    ]
    parts = {f"part{i:03d}": mitsuba_mesh(solid, bsdf) for i, (solid, bsdf) in enumerate(pieces)}
    parts.update(shell.lights())
    return parts
