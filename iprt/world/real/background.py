"""The background: the farthest surfaces that a static camera's video has shown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.world.real.pyramid import PyramidShape

if TYPE_CHECKING:
    from iprt.settings.trace import TraceSettings

OTHER_LIGHT = 0.25
"""Share of the panorama's flux which, if it changes at once, was light that went on or off: what is
remembered looks otherwise now."""


class Background:
    """A second layer of surfaces, behind those of the video's frame, that rays find.

    It holds what the frames since the last cut have shown farthest away in each direction; where
    nothing nearer hides that, it is the frame's own. See `cl/world/real/remember.cl`.

    Attributes
    ----------
    depth : (H, W) float32
        Metres from the capture centre; +inf where open sky was seen.
    normal : (H, W, 3) float32
    color : (H, W, 4) float32
        Linear radiance; the fourth channel is the kernel's own.
    marks : (H, W) uint8
        `SURFACE_OPENING`, `SURFACE_HIDDEN`, `SURFACE_AIMED` of `cl/lib/world/real/real.h`.
    hidden_light : (H, W) float32
        Luminance of what is hidden and brighter than what hides it, else 0.
    surface, range
        As those of `Panorama`.
    farthest : float
        Farthest finite depth, in metres.
    first : bool
        Nothing is remembered but the last frame, which hides nothing.
    """

    def __init__(
        self,
        device: ComputeDevice,
        width: int,
        height: int,
        pyramid: PyramidShape,
        trace: TraceSettings,
    ) -> None:
        """`trace.thickness` decides by how much what hides the background is nearer."""
        self._device = device
        self._trace = trace
        self._size = (width, height)
        texels = (height, width)
        self.depth = device.empty("panorama.background depth", texels)
        self.normal = device.empty("panorama.background normal", (*texels, 3))
        self.color = device.empty("panorama.background color", (*texels, 4))
        self.marks = device.empty("panorama.background marks", texels, np.uint8)
        self.hidden_light = device.empty("panorama.background light", texels)
        self.surface = device.empty("panorama.background surface", (*texels, 4))
        self.range = device.empty("panorama.background range", (pyramid.offsets[-1], 2))
        self.farthest = 0.0
        self._remember = device.kernel("world/real/remember.cl", "remember")
        self._build = device.kernel("world/real/surface.cl", "build_surface", {"BACKGROUND": True})
        self.first, self._seen = True, False

    def load(
        self,
        grid: Mapping[str, Any],
        *,
        depth: cla.Array,
        normal: cla.Array,
        marks: cla.Array,
        radiance: cla.Array,
        surface: cla.Array,
        range_: cla.Array,
        scale: float,
        farthest: float,
        forget: bool,
    ) -> None:
        """Follow the video to a frame; all but the coarser levels of `range`.

        Parameters
        ----------
        grid : mapping
            Size, edges and centres of columns and rows, as `cl/world/real/surface.cl` takes them.
        depth, normal, marks, radiance : (H, W), (H, W, 3), (H, W), (H, W, 4)
            Of the frame, on the device.
        surface, range_ : arrays
            `Panorama.surface`, `Panorama.range` of the frame.
        scale, farthest : float
            As `Panorama` has them.
        forget : bool
            What was seen has nothing to do with this frame, or lies elsewhere.
        """
        self.first = forget or not self._seen
        self._seen = True
        self.farthest = farthest if self.first else max(self.farthest, farthest)
        with self._device.profile.section("background"):
            self._remember(
                self._size,
                width=self._size[0],
                height=self._size[1],
                forget=self.first,
                thickness=self._trace.thickness * scale,
                thickness_ratio=self._trace.thickness_ratio,
                depth=depth,
                normal=normal,
                marks=marks,
                radiance=radiance,
                kept_depth=self.depth,
                kept_normal=self.normal,
                kept_color=self.color,
                kept_marks=self.marks,
                hidden_light=self.hidden_light,
            )
            self._build(
                self._size,
                grid,
                depth=self.depth,
                normal=self.normal,
                marks=self.marks,
                first_surface=surface,
                first_range=range_,
                surface=self.surface,
                range=self.range,
            )

    def arguments(self) -> dict[str, Any]:
        """`BACKGROUND_PARAMETERS` of `cl/lib/world/scene.h`."""
        return {
            "back_surface": self.surface,
            "back_range": self.range,
            "back_color": self.color,
        }
