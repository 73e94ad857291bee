"""Base class and types of the parts of a glTF document."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AliasPath, BaseModel, ConfigDict, Field
from pydantic.alias_generators import to_camel

from iprt.files.safe_reading import MAX_BYTES

Index = Annotated[int, Field(ge=0)]
Bytes = Annotated[int, Field(ge=0, le=MAX_BYTES)]
Number = Annotated[float, Field(allow_inf_nan=False)]

Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]
Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
Quadruple = Annotated[list[Number], Field(min_length=4, max_length=4)]
Matrix = Annotated[list[Number], Field(min_length=16, max_length=16)]


class Part(BaseModel):
    """A part of a glTF document; unknown keys are ignored."""

    model_config = ConfigDict(extra="ignore", strict=True, alias_generator=to_camel)


def extension(*path: str) -> Any:
    """Return a field with a value in the part's `extensions`, or None."""
    return Field(default=None, validation_alias=AliasPath("extensions", *path))
