"""Types of the arguments of `Control`, and materials in words or as tables."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError

from iprt.errors import IprtError
from iprt.files.message_text import printable
from iprt.files.toml_tables import Table, describe
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.scene.material_tables import MaterialTable
from iprt.scene.new_object import parse_material

MAX_SIDE, MAX_FRAMES = 16384, 65536


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value


def _row(value: Any) -> Any:
    return np.ravel(value).tolist() if isinstance(value, (np.ndarray, list, tuple)) else value


Yaw = Annotated[float, Field(ge=-360.0, le=360.0)]
Pitch = Annotated[float, Field(ge=-90.0, le=90.0)]
Fov = Annotated[float, Field(gt=1.0, lt=179.0)]
Vector = Annotated[tuple[float, float, float], BeforeValidator(_plain)]
Matrix = Annotated[list[float], BeforeValidator(_row), Field(min_length=16, max_length=16)]
Positive = Annotated[float, Field(gt=0.0)]
Frames = Annotated[int, Field(ge=1, le=MAX_FRAMES)]
Side = Annotated[int, Field(ge=1, le=MAX_SIDE)]
Size = Annotated[tuple[Side, Side], BeforeValidator(_plain)]
Look = str | dict[str, Any]
"""A material: words as of `iprt scene add --material`, or a table as in scene.toml."""


class _Painted(Table):
    material: MaterialTable


def material_of(look: Look) -> Material:
    """Return a material without maps.

    Raises
    ------
    IprtError
        There is no such material, or it names pictures.
    """
    table = parse_material(look) if isinstance(look, str) else look
    try:
        found = _Painted.model_validate({"material": table}).material
    except ValidationError as error:
        text = describe(error.errors()[0], {"material": table}, None)
        raise IprtError(printable(text)) from None
    if found.maps:
        raise IprtError(
            f"material: {', '.join(found.maps)}: give pictures in scene.toml, which is read again"
        )
    return found.finished(found.material())


def sized(view: View, size: tuple[int, int] | None) -> View:
    """Return a view at a size in pixels, by default its own.

    Raises
    ------
    IprtError
        The view is the whole panorama, and not twice as wide as high.
    """
    width, height = size or (view.width, view.height)
    if view.projection == "equirect" and width != 2 * height:
        raise IprtError(
            f"size {width} {height}: the whole panorama is twice as wide as high; try "
            f"{2 * height} {height}"
        )
    return view.resized(width, height)
