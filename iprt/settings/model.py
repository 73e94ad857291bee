"""Every setting of the renderer, in one model: what TOML, flags and sliders set."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from iprt.settings.filter import AtrousSettings, InterpolateSettings, MaskSettings, TemporalSettings
from iprt.settings.trace import GlossSettings, IrradianceSettings, TraceSettings

Method = Literal["iprt", "ibl"]
"""The published method, or its baseline: the panorama as distant environment, no shadows."""


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
