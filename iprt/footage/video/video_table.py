"""Table `[video]` of `scene.toml`."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Discriminator, Field, Tag, ValidationInfo, field_validator

from iprt.files.kinds import FRAME_PATTERN, PICTURE_SUFFIXES
from iprt.files.toml_tables import (
    Degrees,
    Factor,
    FrameNumber,
    FramePath,
    Point,
    RelativePath,
    Table,
    not_null,
)
from iprt.footage.sun import DISC_DEG, Sun
from iprt.footage.video.placement import Eye, Fit


def _differ(values: list[float]) -> list[float]:
    if values[0] == values[1]:
        raise ValueError("expected two depths that differ")
    return values


Marks = Annotated[list[Annotated[float, Field(allow_inf_nan=True)]], Field(max_length=16)]
LayerName = Annotated[str, Field(min_length=1, max_length=1000)]


class SunTable(Table):
    """`[video.sun]`: a distant light that the panorama does not show.

    Surfaces that face it have this `irradiance`, in the panorama's unit of radiance times sr.
    """

    direction: Annotated[Point, AfterValidator(not_null)]
    irradiance: Annotated[
        list[Annotated[float, Field(ge=0.0, le=1e6)]],
        Field(min_length=3, max_length=3),
        AfterValidator(not_null),
    ]
    angle_deg: Annotated[float, Field(ge=0.05, le=10.0)] = DISC_DEG

    @property
    def sun(self) -> Sun:
        """The sun, with a unit direction."""
        direction = np.array(self.direction)
        red, green, blue = self.irradiance
        return Sun(direction / np.linalg.norm(direction), (red, green, blue), self.angle_deg)


def _tag(value: object) -> str:
    return "table" if isinstance(value, dict | SunTable) else "word"


SunChoice = Annotated[
    Annotated[SunTable, Tag("table")] | Annotated[Literal["auto", "none"], Tag("word")],
    Discriminator(_tag),
]


class VideoTable(Table):
    """Pictures of one frame, printf patterns with a range of frames, or video files.

    `depth` may be omitted if a video file in `color` holds it, and may name the same EXR file.
    `color_layer` and `depth_layer` select layers of EXR files whose names are ambiguous.

    `depth_kind` is "cube" if faces of a cube hold depth along their own axes. `depth_invalid` and
    `depth_sky` are stored values that mark missing depth. If both are missing, they are detected.

    `frames` and `fps` default to the video file's, or to one frame and 30 per second.

    `white` is the linear radiance at which the camera's color clips, `inf` for never. The default
    is 1 for integers, and `inf` for floats and HDR video.

    `eye` selects one half of stereo pictures. `fit` determines how pictures that are not twice as
    wide as high cover the sphere; see `placement_of`.

    `gloss` is "auto" to search the first frame for glossy surfaces, and "declared" to use
    `[[real_materials]]` only.

    `sun` is "auto" to search the first frame for the patches of a sun that the panorama does not
    show, a `[video.sun]` table that declares it, or "none".

    `sky` is "auto" to estimate the sky behind windows where no camera saw it, from the shading of
    the first frame, and "none" to extrapolate it only.
    """

    color: FramePath
    color_layer: LayerName | None = None
    depth: FramePath | None = Field(default=None, validate_default=True)
    depth_layer: LayerName | None = None
    depth_scale: Factor | None = None
    depth_range: (
        Annotated[list[Factor], Field(min_length=2, max_length=2), AfterValidator(_differ)] | None
    ) = None
    depth_encoding: Literal["linear", "inverse"] = "linear"
    depth_kind: Literal["distance", "cube"] = "distance"
    depth_invalid: Marks | None = None
    depth_sky: Marks | None = None
    eye: Eye | None = None
    fit: Fit | None = None
    normal: FramePath | None = None
    poses: RelativePath | None = None
    white: Annotated[float, Field(gt=0.0, allow_inf_nan=True)] | None = None
    yaw_offset_deg: Degrees = 0.0
    frames: Annotated[list[FrameNumber], Field(min_length=2, max_length=2)] | None = None
    fps: Factor | None = None
    loop: bool = False
    gloss: Literal["auto", "declared"] = "auto"
    sun: SunChoice = "auto"
    sky: Literal["auto", "none"] = "auto"

    @field_validator("depth")
    @classmethod
    def _given(cls, depth: str | None, info: ValidationInfo) -> str | None:
        if depth is None and _is_picture(info.data.get("color", "")):
            raise ValueError(
                "required key is missing; name a file of depth (see docs/footage.md), or the file "
                "of color again if it is EXR and holds depth"
            )
        return depth

    @field_validator("depth_range")
    @classmethod
    def _alone(cls, ends: list[float] | None, info: ValidationInfo) -> list[float] | None:
        if info.data.get("depth_scale") is not None:
            raise ValueError("depth_scale is given too; give one of them")
        return ends

    @field_validator("depth_encoding")
    @classmethod
    def _of_range(cls, encoding: str, info: ValidationInfo) -> str:
        if info.data.get("depth_range", encoding) is None:
            raise ValueError("has no effect without depth_range; give depth_range too")
        return encoding

    @field_validator("depth_sky")
    @classmethod
    def _not_invalid(cls, sky: list[float] | None, info: ValidationInfo) -> list[float] | None:
        for value in sky or ():
            if value in (info.data.get("depth_invalid") or ()):
                raise ValueError(f"{value:g} is in depth_invalid too; leave it out of one")
        return sky

    @field_validator("frames")
    @classmethod
    def _ordered(cls, frames: list[int] | None, info: ValidationInfo) -> list[int] | None:
        first, last = frames or (0, 0)
        color = info.data.get("color", "")
        if first > last:
            raise ValueError(f"the first, {first}, is after the last, {last}")
        if first < last and _is_picture(color) and not FRAME_PATTERN.search(color):
            raise ValueError(
                f"color = '{color}' is one picture; write a pattern such as color.%04d.exr"
            )
        return frames


def _is_picture(name: str) -> bool:
    return bool(FRAME_PATTERN.search(name)) or name.lower().endswith(PICTURE_SUFFIXES)
