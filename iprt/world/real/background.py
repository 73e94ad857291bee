"""Background: the farthest surfaces that a static camera's video has shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.block import Block, Float2s, Float4s, Floats
from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant
from iprt.world.real.changed_surfaces import runs, span_of, widened
from iprt.world.real.pyramid import PyramidShape
from iprt.world.real.surfaces import Surfaces

STRIP = constant("world/real/background.cl", "STRIP")
if TYPE_CHECKING:
    from iprt.settings.trace import TraceSettings

OTHER_LIGHT = 0.25
"""Sudden change of the panorama's flux, as a share, that means light was switched: the remembered
radiance is no longer valid."""


@dataclass(kw_only=True)
class BackgroundArgs(Block):
    """Second layer of surfaces for rays: `surface`, `range` and `color` of `Background`."""

    surface: Float4s
    range: Float2s
    color: Floats


class Background:
    """Second layer of surfaces for rays, behind the video's frame.

    It holds the farthest surfaces that frames since the last cut have shown in each direction.
    Where nothing nearer hides them, they equal the frame's own. See `cl/world/real/remember.cl`.

    Attributes
    ----------
    depth : (H, W) float32
        Metres from the capture centre; +inf where open sky was seen.
    plane : (H, W, 3) float32
        g of the tangent plane, see `cl/lib/world/real/real.h`; 0 in open sky.
    color : (H, W, 3) float32
        Linear radiance.
    around : (H, W) float32
        Slow mean of `depth`; negative where `color` may be mixed with a nearer surface's.
    marks : (H, W) uint8
        `SURFACE_OPENING`, `SURFACE_HIDDEN`, `SURFACE_AIMED` of `cl/lib/world/real/real.h`.
    hidden_light : (H, W) float32
        Luminance of the background where a darker surface hides it, else 0.
    surface, range
        As in `Panorama`.
    farthest : float
        Farthest finite depth, in metres.
    first : bool
        Only the last frame is remembered, which hides nothing.
    """

    def __init__(
        self,
        device: ComputeDevice,
        surfaces: Surfaces,
        pyramid: PyramidShape,
        trace: TraceSettings,
    ) -> None:
        """Create the buffers.

        `surfaces` are the frame's. `trace.thickness` is the least distance between the background
        and a surface that hides it.
        """
        self._trace = trace
        self._first = surfaces
        width, height = surfaces.width, surfaces.height
        texels = (height, width)
        self.depth = device.empty("panorama.background depth", texels)
        self.plane = device.empty("panorama.background plane", (*texels, 3))
        self.color = device.empty("panorama.background color", (*texels, 3))
        self.around = device.empty("panorama.background around", texels)
        self.marks = device.empty("panorama.background marks", texels, np.uint8)
        self.hidden_light = device.empty("panorama.background light", texels)
        self.surface = device.empty("panorama.background surface", (*texels, 4))
        self.range = device.empty("panorama.background range", (pyramid.offsets[-1], 2))
        items, lines = surfaces.items(height)
        self._quiet = device.empty("panorama.background quiet", (lines, items), np.uint8)
        self.farthest = 0.0
        wide = {"WIDE": device.wide}
        self._remember = device.kernel("world/real/remember.cl", "remember", wide)
        self._join = device.kernel("world/real/background.cl", "join_background")
        self.first, self._seen = True, False
        self._touched = np.zeros(height, bool)

    def load(
        self,
        *,
        radiance: cla.Array,
        strips: cla.Array,
        range_: cla.Array,
        scale: float,
        farthest: float,
        changed: NDArray[np.bool_],
        columns: slice,
        forget: bool,
    ) -> slice:
        """Load a frame of the video; fills all but the coarser levels of `range`.

        Parameters
        ----------
        radiance, range_, scale, farthest
            As in `Panorama`.
        strips
            `PictureLoader.sums`.
        changed : (H,) bool
            Rows in which the frame's surfaces may differ from the last frame's.
        columns : slice
            Columns in which they may.
        forget : bool
            Earlier frames are unrelated to this one, or lie elsewhere.

        Returns
        -------
        slice
            Rows of `range` that may have changed.
        """
        self.first = forget or not self._seen
        self._seen = True
        self.farthest = farthest if self.first else max(self.farthest, farthest)
        first = self._first
        known = {"kept_depth": self.depth, "kept_plane": self.plane, "kept_marks": self.marks}
        changed = changed | self.first
        for rows in runs(changed):
            self._remember(
                first.items(rows.stop - rows.start),
                first.grid,
                known,
                first=rows.start,
                rows=rows.stop - rows.start,
                left=columns.start,
                right=columns.stop if changed[rows.start] else columns.start,
                forget=self.first,
                thickness_m=self._trace.thickness * scale,
                thickness_ratio=self._trace.thickness_ratio,
                inverse=first.inverse,
                lines=first.lines,
                surface=first.surface,
                radiance=radiance,
                strips=strips,
                kept_color=self.color,
                kept_around=self.around,
                hidden_light=self.hidden_light,
                quiet=self._quiet,
            )
        # Elsewhere the background is the frame, as it was.
        self._touched |= widened(changed)
        rows = span_of(self._touched)
        if rows.stop > rows.start:
            self._join(
                (-(-first.width // STRIP), rows.stop - rows.start),
                first.grid,
                known,
                first=rows.start,
                rows=rows.stop - rows.start,
                first_surface=first.surface,
                first_range=range_,
                surface=self.surface,
                range=self.range,
            )
        if self.first:
            self._touched[:] = False
        return rows

    def arguments(self) -> BackgroundArgs:
        """Return the layer for rays."""
        return BackgroundArgs(surface=self.surface, range=self.range, color=self.color)
