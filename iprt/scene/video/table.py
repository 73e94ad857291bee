"""`[video]` of `scene.toml`."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from iprt.scene.table import Degrees, Factor, FrameNumber, FramePath, Table


class VideoTable(Table):
    """Pictures of one frame, or printf patterns and a range of frames."""

    color: FramePath
    depth: FramePath
    depth_scale: Factor | None = None
    normal: FramePath | None = None
    yaw_offset_deg: Degrees = 0.0
    frames: Annotated[list[FrameNumber], Field(min_length=2, max_length=2)] = Field(default=[0, 0])
    fps: Factor = 30.0
    loop: bool = False
