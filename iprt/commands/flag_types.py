"""Flags that take numbers: help and errors name their number and meaning."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, TypeVar

from tyro.constructors import PrimitiveConstructorSpec

Number = TypeVar("Number", int, float)
WHOLE = "two whole numbers"


def _pair(
    number: Callable[[str], Number], kind: str, first: str, second: str
) -> PrimitiveConstructorSpec[tuple[Number, Number] | None]:
    def parsed(words: list[str]) -> tuple[Number, Number]:
        try:
            return number(words[0]), number(words[1])
        except ValueError:
            raise ValueError(f"expected {first} {second}, {kind}; got {' '.join(words)}") from None

    return PrimitiveConstructorSpec(
        nargs=2,
        metavar=f"{first} {second}",
        instance_from_str=parsed,
        is_instance=lambda value: value is None or isinstance(value, tuple),
        str_from_instance=lambda pair: ["None"] if pair is None else [str(end) for end in pair],
    )


def _any_number() -> PrimitiveConstructorSpec[tuple[float, ...] | None]:
    def parsed(words: list[str]) -> tuple[float, ...]:
        try:
            return tuple(float(word) for word in words)
        except ValueError:
            raise ValueError(f"expected numbers; got {' '.join(words)}") from None

    return PrimitiveConstructorSpec(
        nargs="*",
        metavar="[VALUE ...]",
        instance_from_str=parsed,
        is_instance=lambda value: value is None or isinstance(value, tuple),
        str_from_instance=lambda values: ["None"] if values is None else list(map(str, values)),
    )


Size = Annotated[tuple[int, int] | None, _pair(int, WHOLE, "WIDTH", "HEIGHT")]
DepthRange = Annotated[tuple[float, float] | None, _pair(float, "two numbers", "LOW", "HIGH")]
Values = Annotated[tuple[float, ...] | None, _any_number()]
