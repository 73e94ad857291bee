"""Methods that check their arguments, and that other processes may call."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Concatenate, ParamSpec, TypeVar

from pydantic import ConfigDict, ValidationError, validate_call

from iprt.errors import IprtError
from iprt.files.message_text import printable
from iprt.files.toml_tables import describe

Owner = TypeVar("Owner")
Given = ParamSpec("Given")
Result = TypeVar("Result")

CONFIG = ConfigDict(allow_inf_nan=False, arbitrary_types_allowed=True)
METHODS: set[str] = set()
"""Names of the methods that other processes may call."""


def checked(
    method: Callable[Concatenate[Owner, Given], Result],
) -> Callable[Concatenate[Owner, Given], Result]:
    """Decorate a method so that other processes may call it, and wrong arguments are `IprtError`.

    The arguments must have the annotated types, or be plain data that can be converted to them.
    """
    METHODS.add(method.__name__)
    valid: Callable[..., Result] = validate_call(config=CONFIG)(method)
    names = list(inspect.signature(method).parameters)

    @functools.wraps(method)
    def call(owner: Owner, /, *args: Given.args, **kwargs: Given.kwargs) -> Result:
        try:
            return valid(owner, *args, **kwargs)
        except ValidationError as error:
            fault = error.errors()[0]
            place, *rest = fault["loc"]
            if isinstance(place, int):  # of a positional argument
                place = names[place] if place < len(names) else "arguments"
            text = describe({**fault, "loc": (place, *rest)}, {}, None)
            raise IprtError(f"{method.__name__}: {printable(text)}") from None

    return call
