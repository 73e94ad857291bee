"""Every knob of the renderer, in one model: what TOML, flags and sliders set."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from iprt.passes.atrous import AtrousSettings
from iprt.passes.interpolate import InterpolateSettings
from iprt.passes.irradiance import IrradianceSettings
from iprt.passes.mask import MaskSettings
from iprt.passes.temporal import TemporalSettings

Method = Literal["iprt", "ibl"]
"""The published method, or its baseline: the panorama as distant environment, no shadows."""


class TraceSettings(BaseModel):
    """What rays assume of the scene, and how far paths go."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    objects: Literal["bvh", "raster"] = Field(
        default="bvh",
        description="What rays meet of objects: their triangles, or two layers of them rasterized "
        "from the capture centre.",
    )
    estimator: Literal["delta", "ratio"] = Field(
        default="delta",
        description="How real surfaces are relit: by what objects change in a cached irradiance, "
        "or by the quotient of irradiances with and without them (IPRT Eq. 2).",
    )
    light_sampling: bool = Field(
        default=True,
        description="Aim rays at the bright parts of the panorama too; off: by reflectance only.",
    )
    rays: int = Field(
        default=1,
        ge=1,
        le=1024,
        description="Rays per traced pixel of real surfaces and frame; noise ∝ 1/√rays.",
        json_schema_extra={"unit": "rays"},
    )
    object_rays: int = Field(
        default=4,
        ge=1,
        le=1024,
        description="The same for pixels of objects in their first eight frames; a quarter later, "
        "up to four times as many at their edges.",
        json_schema_extra={"unit": "rays"},
    )
    bounces: int = Field(
        default=4,
        ge=1,
        le=16,
        description="Virtual surfaces that a path may meet before it sees real ones only.",
    )
    thickness: float = Field(
        default=0.05,
        ge=0.0,
        le=10.0,
        description="Least thickness of real surfaces, in a room (median depth 2 m).",
        json_schema_extra={"unit": "m"},
    )
    thickness_ratio: float = Field(
        default=0.05,
        ge=0.0,
        le=1.0,
        description="Least thickness of real surfaces as a fraction of their distance.",
    )
    back_faces: bool = Field(
        default=True, description="Substitute back faces that the camera never saw (BASSRT)."
    )
    background: bool = Field(
        default=True,
        description="Remember what moving things hide in the video of a camera that stays, for "
        "rays that pass behind these.",
    )
    openings: Literal["environment", "surface"] = Field(
        default="environment",
        description="What windows show: what is far behind them, or their own radiance.",
    )
    jitter: bool = Field(
        default=True,
        description="Shade objects at points all over each pixel, which smooths reflections; with "
        "objects = bvh.",
    )
    relight_reflections: bool = Field(
        default=True, description="Objects reflect shadows and light that objects cast."
    )
    ratio_rows: int = Field(
        default=64,
        ge=16,
        le=2048,
        description="Rows of the panorama that holds such shadows where the view does not show "
        "them.",
        json_schema_extra={"unit": "rows"},
    )


class GlossSettings(BaseModel):
    """Glossy real surfaces, where a scene declares any (`[[real_materials]]`)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    rays: int = Field(
        default=4,
        ge=1,
        le=4096,
        description="Rays per glossy texel, once per video frame, that find the highlight to take "
        "off.",
        json_schema_extra={"unit": "rays"},
    )


class Settings(BaseModel):
    """Settings of a renderer; immutable, so that a picture's settings can be stored with it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    method: Method = Field(default="iprt", description="Rendering method.")
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of all random numbers.")
    fading: float = Field(
        default=0.1,
        ge=0.0,
        le=1.0,
        description="Least share of a new frame in the temporal mean; 0 averages all frames.",
    )
    drift: bool = Field(
        default=True,
        description="Take off the drift of a video's exposure and white balance from what rays "
        "find, and put it back on the picture: histories hold while the camera adapts.",
    )
    gbuffer: Literal["gl", "cl"] = Field(
        default="gl",
        description="What draws the objects that the view shows: OpenGL, or rays in OpenCL, which "
        "is also taken where OpenGL is missing.",
    )
    check_kernels: bool = Field(
        default=False,
        description="Check all that kernels write, and stop at the first NaN, infinity or write "
        "beside a buffer with the name of pass, kernel and buffer. The picture stays the same and "
        "takes several times as long.",
    )
    trace: TraceSettings = TraceSettings()
    gloss: GlossSettings = GlossSettings()
    irradiance: IrradianceSettings = IrradianceSettings()
    mask: MaskSettings = MaskSettings()
    interpolate: InterpolateSettings = InterpolateSettings()
    temporal: TemporalSettings = TemporalSettings()
    atrous: AtrousSettings = AtrousSettings()
