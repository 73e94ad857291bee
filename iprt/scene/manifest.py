"""`scene.toml`, format 1: its model, and a report of all its problems at once.

The models validate the file itself. Sizes and missing files are checked by the scene.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol, Self, TypeVar

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from iprt.errors import SceneError
from iprt.files.safe_reading import MAX_OBJECTS, MAX_SIDE
from iprt.files.toml_tables import (
    FARTHEST,
    MAX_PROBLEMS,
    Degrees,
    Factor,
    FieldOfView,
    FramePath,
    Name,
    Pitch,
    Pixel,
    RelativePath,
    Side,
    Table,
    describe,
    problems_error,
)
from iprt.files.toml_text import parse_toml, read_text
from iprt.footage.real_material import MAX_REAL_MATERIALS
from iprt.footage.video.video_table import SunTable, VideoTable
from iprt.geometry.camera import View
from iprt.geometry.keyframes import (
    Clip,
    ObjectKeyframe,
    ObjectKeyframes,
    ViewKeyframe,
    ViewKeyframes,
)
from iprt.geometry.light import MOST_LIGHTS
from iprt.scene.light_tables import LIGHTS, LightTable
from iprt.scene.material_tables import (
    ConductorTable,
    DiffuseTable,
    MaterialTable,
    PlaneTable,
    PlasticTable,
    PrincipledTable,
    RealConductorTable,
    RealMaterialTable,
    RealPlasticTable,
)

MANIFEST_NAME = "scene.toml"
AUTOSAVE_NAME = ".iprt-autosave"
"""Folder in the scene's in which viewers keep unsaved edits; it is no part of the scene."""
MAX_VIEWS = 4096


def allowed_transform(values: list[float]) -> list[float]:
    """Check the 16 values of an object's (4, 4) transform, row-major, and return them.

    Raises
    ------
    ValueError
        They are not finite, too large, or singular.
    """
    matrix = np.array(values, np.float64).reshape(4, 4)
    if not np.isfinite(matrix).all():
        raise ValueError("expected finite numbers")
    if np.abs(matrix).max() > FARTHEST:
        raise ValueError(
            f"holds {max(values, key=abs):g}; at most {FARTHEST:g} (metres) is allowed"
        )
    if list(matrix[3]) != [0.0, 0.0, 0.0, 1.0]:
        raise ValueError("the last row must be 0, 0, 0, 1 (row-major, column vectors)")
    scale = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    if not scale[2] > 1e-6 * scale[0]:
        raise ValueError("the matrix is singular: it flattens the object")
    return values


class ObjectTable(Table):
    """`[[objects]]`: a mesh, or a light without geometry, with its placement and motion."""

    name: Name
    mesh: RelativePath | None = None
    light: LightTable | None = None
    to_world: Annotated[
        list[float], Field(min_length=16, max_length=16), AfterValidator(allowed_transform)
    ]
    material: MaterialTable | None = None
    animation: Clip = None
    keyframes: ObjectKeyframes = Field(default=[])
    group: Name | None = None
    locked: bool = False

    @model_validator(mode="after")
    def _is_something(self) -> Self:
        if (self.mesh is None) == (self.light is None):
            raise ValueError("needs either a mesh or a light")
        for key in ("material", "animation"):
            if self.light is not None and getattr(self, key) is not None:
                raise ValueError(f"is a light, which has no {key}")
        return self


class ViewTable(Table):
    """`[[views]]`: a picture to render, and its ground truth."""

    name: Name
    yaw_deg: Degrees = 0.0
    pitch_deg: Pitch = 0.0
    fov_y_deg: FieldOfView = 60.0
    size: Annotated[list[Side], Field(min_length=2, max_length=2)]
    objects: list[str] | None = None
    truth: FramePath | None = None
    truth_background: FramePath | None = None
    truth_mask: FramePath | None = None
    truth_outdated: bool = False
    cuts: list[Annotated[list[Pixel], Field(min_length=4, max_length=4)]] = Field(default=[])
    keyframes: ViewKeyframes = Field(default=[])

    @field_validator("cuts")
    @classmethod
    def _inside(cls, cuts: list[list[int]], info: ValidationInfo) -> list[list[int]]:
        width, height = info.data.get("size", (MAX_SIDE, MAX_SIDE))
        for cut in cuts:
            x0, y0, x1, y1 = cut
            if not (x0 < x1 <= width and y0 < y1 <= height):
                raise ValueError(f"{cut} is empty or outside the {width} x {height} picture")
        return cuts

    @property
    def view(self) -> View:
        """The view without keyframes."""
        width, height = self.size
        return View(width, height, self.yaw_deg, self.pitch_deg, self.fov_y_deg)


class _Named(Protocol):
    @property
    def name(self) -> str: ...


NamedTable = TypeVar("NamedTable", bound=_Named)


def _unique(tables: list[NamedTable]) -> list[NamedTable]:
    (name, count), *_ = Counter(table.name for table in tables).most_common(1) or [("", 0)]
    if count > 1:
        raise ValueError(f"{count} of them are named '{name}'; names must differ")
    return tables


class Manifest(Table):
    """A whole `scene.toml`."""

    format: Literal[1]
    name: Name
    exposure: Factor = 1.0
    nits: Factor = 100.0
    """Luminance in cd/m² of a radiance of 1, by which lights have photometric units."""
    video: VideoTable
    objects: Annotated[
        list[ObjectTable], Field(max_length=MAX_OBJECTS), AfterValidator(_unique)
    ] = Field(default=[])
    real_materials: Annotated[
        list[RealMaterialTable], Field(max_length=MAX_REAL_MATERIALS), AfterValidator(_unique)
    ] = Field(default=[])
    views: Annotated[list[ViewTable], Field(max_length=MAX_VIEWS), AfterValidator(_unique)] = Field(
        default=[]
    )
    settings: dict[str, Any] = Field(default={})
    """`[settings]`: settings that suit the scene, checked where they are used."""

    @field_validator("objects")
    @classmethod
    def _few_lights(cls, objects: list[ObjectTable]) -> list[ObjectTable]:
        lights = sum(table.light is not None for table in objects)
        if lights > MOST_LIGHTS:
            raise ValueError(f"{lights} of them are lights without geometry; at most {MOST_LIGHTS}")
        return objects

    @field_validator("views")
    @classmethod
    def _known_objects(cls, views: list[ViewTable], info: ValidationInfo) -> list[ViewTable]:
        known = [table.name for table in info.data.get("objects", ())]
        for view in views if "objects" in info.data else ():
            for name in view.objects or ():
                if name not in known:
                    has = ", ".join(known[:100]) or "none"
                    raise ValueError(
                        f"{view.name}: no object is named '{name}'; the scene has {has}"
                    )
        return views


def read_manifest(path: Path) -> Manifest:
    """Read and check `scene.toml`.

    Raises
    ------
    SceneError
        The file is unreadable or no TOML, or has problems, all listed by key.
    """
    return parse_manifest(manifest_text(path), str(path))


def manifest_text(path: Path) -> str:
    """Return the text of `scene.toml`, as `read_text` does.

    Raises
    ------
    SceneError
        The file is unreadable or not UTF-8.
    """
    try:
        return read_text(path)
    except FileNotFoundError as error:
        raise SceneError(f"{path}: no such file; `iprt scene new` makes a scene") from error
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise SceneError(f"{path}: {error}") from error


def parse_manifest(text: str, source: str) -> Manifest:
    """Parse a manifest like `read_manifest`, from text; `source` names it in errors."""
    try:
        data = parse_toml(text)
    except ValueError as error:
        raise SceneError(f"{source}: {error}") from error
    try:
        return Manifest.model_validate(data)
    except ValidationError as error:
        faults = error.errors()[: MAX_PROBLEMS + 1]
        problems = [describe(fault, data, _table_of(fault["loc"])) for fault in faults]
        raise problems_error(source, problems) from None


_TABLES: dict[tuple[str, str], type[BaseModel]] = {
    ("video", "video"): VideoTable,
    ("video", "table"): SunTable,
    ("objects", "objects"): ObjectTable,
    ("objects", "keyframes"): ObjectKeyframe,
    ("objects", "diffuse"): DiffuseTable,
    ("objects", "conductor"): ConductorTable,
    ("objects", "plastic"): PlasticTable,
    ("objects", "principled"): PrincipledTable,
    **{("objects", kind): table for kind, table in LIGHTS.items()},
    ("real_materials", "conductor"): RealConductorTable,
    ("real_materials", "plastic"): RealPlasticTable,
    ("real_materials", "plane"): PlaneTable,
    ("views", "views"): ViewTable,
    ("views", "keyframes"): ViewKeyframe,
}
"""Tables by the first and the last name on the path to their keys."""


def _table_of(location: tuple[Any, ...]) -> type[BaseModel] | None:
    """Return the table with the keys that a problem's innermost key may have meant."""
    names = [step for step in location[:-1] if isinstance(step, str)]
    return _TABLES.get((names[0], names[-1])) if names else Manifest
