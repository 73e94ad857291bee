"""Types of flags with several values.

Numbers are separated by spaces, and help and errors name each of them. Names may be repeated or
separated by commas.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Annotated, TypeVar

from tyro.constructors import PrimitiveConstructorSpec

Number = TypeVar("Number", int, float)


def _numbers(
    number: Callable[[str], Number], kind: str, *names: str
) -> PrimitiveConstructorSpec[tuple[Number, ...] | None]:
    """Return the type of a flag that takes a number for each of `names`; without, any number."""

    def parsed(words: list[str]) -> tuple[Number, ...]:
        try:
            return tuple(number(word) for word in words)
        except ValueError:
            expected = ", ".join(filter(None, (" ".join(names), kind)))
            raise ValueError(f"expected {expected}; got {' '.join(words)}") from None

    return PrimitiveConstructorSpec(
        nargs=len(names) or "*",
        metavar=" ".join(names) or "[VALUE ...]",
        instance_from_str=parsed,
        is_instance=lambda value: value is None or isinstance(value, tuple),
        str_from_instance=lambda values: ["None"] if values is None else list(map(str, values)),
    )


Size = Annotated[tuple[int, int] | None, _numbers(int, "two whole numbers", "WIDTH", "HEIGHT")]
DepthRange = Annotated[tuple[float, float] | None, _numbers(float, "two numbers", "LOW", "HIGH")]
Direction = Annotated[tuple[float, float], _numbers(float, "degrees", "YAW", "PITCH")]
Position = Annotated[tuple[float, float, float] | None, _numbers(float, "metres", "X", "Y", "Z")]
Rotation = Annotated[tuple[float, float, float] | None, _numbers(float, "degrees", "X", "Y", "Z")]
Color = Annotated[tuple[float, float, float] | None, _numbers(float, "numbers", "R", "G", "B")]
Angles = Annotated[tuple[float, float] | None, _numbers(float, "degrees", "INNER", "OUTER")]
Sides = Annotated[tuple[float, float] | None, _numbers(float, "metres", "WIDTH", "HEIGHT")]
Values = Annotated[tuple[float, ...] | None, _numbers(float, "numbers")]


def listed(values: Iterable[str]) -> tuple[str, ...]:
    """Return the names of a repeated flag in order: `a,b` twice is a, b, a, b."""
    return tuple(part.strip() for value in values for part in value.split(","))
