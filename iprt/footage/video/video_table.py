"""Table `[video]` of `scene.toml`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from iprt.files.table import Degrees, Factor, FrameNumber, FramePath, RelativePath, Table
from iprt.footage.video.placement import Eye, Fit


def _differ(values: list[float]) -> list[float]:
    if values[0] == values[1]:
        raise ValueError("expected two depths that differ")
    return values


Marks = Annotated[list[Annotated[float, Field(allow_inf_nan=True)]], Field(max_length=16)]
LayerName = Annotated[str, Field(min_length=1, max_length=1000)]


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
    """

    color: FramePath
    color_layer: LayerName | None = None
    depth: FramePath | None = None
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
