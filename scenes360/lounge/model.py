"""The room of `scenes360.room` with a polished floor and finer textures."""

from __future__ import annotations

from typing import Any

from scenes360.room import model

FLOOR_ALPHA, DETAIL = 0.08, 3


def build() -> dict[str, Any]:
    """Return all parts of the room, without the inserted objects."""
    return model.build(FLOOR_ALPHA, DETAIL)
