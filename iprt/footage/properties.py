"""Properties of a video that determine passes and buffers."""

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
        Whether there are windows.
    real_materials : tuple of Material
        Materials of glossy real surfaces.
    clips : bool
        Whether frames may have `Frame.clipped`: clipped lights, or a sun's disc.
    drifts : bool
        Whether some frames may have a `color_map`.
    poses : bool
        Whether frames have poses.
    video : bool
        Whether there are several frames.
    static_camera : bool
        Whether all frames share one place. Surfaces hidden by moving objects can then be
        remembered.
    sun : bool
        Whether there is a sun that the panorama need not show.
    """

    openings: bool = False
    real_materials: tuple[Material, ...] = ()
    clips: bool = False
    drifts: bool = False
    poses: bool = False
    video: bool = False
    static_camera: bool = False
    sun: bool = False

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
        """Derive the properties from one frame; the flags add properties of other frames."""
        return cls(
            openings=bool(frame.opening.any()),
            real_materials=frame.real_materials,
            clips=clips or frame.clipped is not None or (video and frame.sun is not None),
            drifts=drifts or frame.color_map is not None,
            poses=frame.pose is not None,
            video=video,
            static_camera=static_camera,
            sun=frame.sun is not None,
        )
