"""Types of flags that take several numbers, separated by spaces.

Help and errors name each of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, TypeVar

from tyro.constructors import PrimitiveConstructorSpec

Number = TypeVar("Number", int, float)


def _vector(
    number: Callable[[str], Number], kind: str, *names: str
) -> PrimitiveConstructorSpec[tuple[Number, ...] | None]:
    def parsed(words: list[str]) -> tuple[Number, ...]:
        try:
            return tuple(number(word) for word in words)
        except ValueError:
            expected = f"expected {' '.join(names)}, {kind}"
            raise ValueError(f"{expected}; got {' '.join(words)}") from None

    return PrimitiveConstructorSpec(
        nargs=len(names),
        metavar=" ".join(names),
        instance_from_str=parsed,
        is_instance=lambda value: value is None or isinstance(value, tuple),
        str_from_instance=lambda vector: ["None"] if vector is None else list(map(str, vector)),
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


Size = Annotated[tuple[int, int] | None, _vector(int, "two whole numbers", "WIDTH", "HEIGHT")]
DepthRange = Annotated[tuple[float, float] | None, _vector(float, "two numbers", "LOW", "HIGH")]
Direction = Annotated[tuple[float, float], _vector(float, "degrees", "YAW", "PITCH")]
Position = Annotated[tuple[float, float, float] | None, _vector(float, "metres", "X", "Y", "Z")]
Values = Annotated[tuple[float, ...] | None, _any_number()]
