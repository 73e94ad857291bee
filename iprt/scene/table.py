"""What all tables of `scene.toml` share."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

FARTHEST = 1e6
"""Largest number in a transform: beyond, 32-bit floats have no centimetres left."""

Point = Annotated[
    list[Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]], Field(min_length=3, max_length=3)
]
Degrees = Annotated[float, Field(ge=-36000.0, le=36000.0)]
Pitch = Annotated[float, Field(ge=-90.0, le=90.0)]
FieldOfView = Annotated[float, Field(ge=0.01, lt=180.0)]


class Table(BaseModel):
    """A table with no other keys than its own, each of its own type."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)
