"""Properties of a video that passes and buffers depend on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from iprt.footage.frame import Frame
from iprt.geometry.material import Material


@dataclass(frozen=True)
class Footage:
    """Properties of the frames of one video.

    Attributes
    ----------
    openings : bool
        There are windows.
    real_materials : tuple of Material
        Materials of glossy real surfaces.
    clips : bool
        Lights may be clipped in some frames (`Frame.clipped`).
    drifts : bool
        Some may have a `color_map`.
    poses : bool
        They have poses.
    video : bool
        There are several frames.
    static_camera : bool
        All frames are seen from the same place, so that what moving things hide can be remembered.
    """

    openings: bool = False
    real_materials: tuple[Material, ...] = ()
    clips: bool = False
    drifts: bool = False
    poses: bool = False
    video: bool = False
    static_camera: bool = False

    @classmethod
    def of(
        cls,
        frame: Frame,
        *,
        clips: bool = False,
        drifts: bool = False,
        video: bool = False,
        static_camera: bool = False,
    ) -> Self:
        """By one frame; the flags say what other frames may have besides."""
        return cls(
            openings=bool(frame.opening.any()),
            real_materials=frame.real_materials,
            clips=clips or frame.clipped is not None,
            drifts=drifts or frame.color_map is not None,
            poses=frame.pose is not None,
            video=video,
            static_camera=static_camera,
        )
