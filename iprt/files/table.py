"""The base class of all tables of `scene.toml`, and the types of their values."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from iprt.files.path_safety import stays_inside
from iprt.files.problems import FRAME_PATTERN
from iprt.files.toml_text import printable
from iprt.files.untrusted import MAX_SIDE

LAST_FRAME = 999_999
FARTHEST = 1e6
"""Largest number in a transform; beyond it, 32-bit floats cannot resolve centimetres."""


def _relative_path(text: str) -> str:
    """Validate a path that stays in the scene's folder."""
    if not stays_inside(text):
        raise ValueError(f"'{text}' leaves the scene's folder; copy the file into it")
    if not text or text.endswith("/") or text != printable(text, len(text)):
        raise ValueError(f"'{text}': expected the name of a file")
    return text


def _frame_path(text: str) -> str:
    """Validate a path that may hold the frame's number."""
    if "%" in FRAME_PATTERN.sub("", text, count=1):
        raise ValueError(f"'{text}': expected at most one %d or %04d and no other %")
    return _relative_path(text)


def _plain_name(text: str) -> str:
    if not text.strip() or set(text) & {"/", "\\"} or text != printable(text):
        raise ValueError(f"'{text}': expected a name without slashes")
    return text


RelativePath = Annotated[str, AfterValidator(_relative_path)]
FramePath = Annotated[str, AfterValidator(_frame_path)]
Name = Annotated[str, AfterValidator(_plain_name)]
Unit = Annotated[float, Field(ge=0.0, le=1.0)]
Color = Annotated[list[Unit], Field(min_length=3, max_length=3)]
Ior = Annotated[float, Field(gt=1.0, le=4.0)]
Side = Annotated[int, Field(ge=1, le=MAX_SIDE)]
Pixel = Annotated[int, Field(ge=0, le=MAX_SIDE)]
FrameNumber = Annotated[int, Field(ge=0, le=LAST_FRAME)]
Factor = Annotated[float, Field(gt=0.0, le=1e12)]
Point = Annotated[
    list[Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]], Field(min_length=3, max_length=3)
]
Degrees = Annotated[float, Field(ge=-36000.0, le=36000.0)]
Pitch = Annotated[float, Field(ge=-90.0, le=90.0)]
FieldOfView = Annotated[float, Field(ge=0.01, lt=180.0)]


class Table(BaseModel):
    """A table without unknown keys, whose values have exactly the declared types."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)
