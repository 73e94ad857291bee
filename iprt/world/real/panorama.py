"""The real scene on the device: what depends on the video frame only."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.files.kernel_source import constant
from iprt.footage.frame import Frame
from iprt.footage.window_environment import OUTSIDE_ROWS, outside_radiance
from iprt.world.real.background import Background
from iprt.world.real.pyramid import Pyramid, PyramidShape, equirect_centres, equirect_edges

if TYPE_CHECKING:
    from iprt.settings.trace import TraceSettings

COARSEST_COLUMNS = 8
"""Cells span at most π/4 of azimuth, so that one plane per meridian decides a crossing."""
SURFACE_OPENING = np.uint8(constant("lib/world/real/real.h", "SURFACE_OPENING"))
START_BIAS = 1e-3
"""Metres, in a room: tolerance of a ray's start against the surface it starts from."""


class Panorama:
    """Radiance, tangent planes and depth pyramid of the current video frame.

    Attributes
    ----------
    width, height : int
    color : (H, W, 4) float32
        Linear radiance as the picture shows it; the fourth channel is unused.
    radiance : (H, W, 4) float32
        `Frame.radiance`: `color` itself, or a buffer of its own where asked for.
    surface : (H, W, 4) float32
        Tangent plane and flags per texel, see `cl/lib/world/real/real.h`.
    outside : (OUTSIDE_ROWS, 2 OUTSIDE_ROWS, 4) float32 or None
        What lies behind windows, as a distant environment, where asked for.
    gloss : (H, W) uint8 or None
        0 where the surface is diffuse, else 1 + index of its real material, where asked for.
    highlight : (H, W, 4) float32 or None
        With `gloss`: the part of `radiance` that is specular reflection towards the capture centre
        (`Highlight`).
    radiated : (H, W, 4) float32
        What rays find where they meet a real surface: `radiance` itself, but without highlights
        where surfaces are glossy (`Highlight`).
    range : (cells, 2) float32
        Min/max pyramid of radial distances, level 0 first.
    background : Background or None
        What the video has shown behind all this, where that is remembered.
    median_depth, nearest, farthest : float
        Median, least and largest finite depth, in metres; `farthest` is 0 where all is open sky.
    mean_radiance : float
        Over the sphere and the three channels.
    """

    def __init__(
        self,
        device: ComputeDevice,
        width: int,
        height: int,
        *,
        outside: bool = False,
        gloss: bool = False,
        separate_radiance: bool = False,
        background: TraceSettings | None = None,
    ) -> None:
        """`separate_radiance`: frames may have a radiance besides colour; `background`: what
        they hide is remembered, by the thickness that surfaces are assumed to have.
        """
        # Tiny panoramas are repeated texel by texel until the coarsest cells are narrow enough.
        self._repeat = max(1, -(-COARSEST_COLUMNS // width))
        self.width, self.height = width * self._repeat, height * self._repeat
        self._device = device
        self.shape = PyramidShape.of(self.width, self.height, COARSEST_COLUMNS)
        texels = (self.height, self.width)
        self.color = device.empty("panorama.color", (*texels, 4))
        self.surface = device.empty("panorama.surface", (*texels, 4))
        self.range = device.empty("panorama.range", (self.shape.offsets[-1], 2))
        self.outside = None
        if outside:
            self.outside = device.empty("panorama.outside", (OUTSIDE_ROWS, 2 * OUTSIDE_ROWS, 4))
        self.radiance = self.color
        if separate_radiance:
            self.radiance = device.empty("panorama.radiance", (*texels, 4))
        self.gloss = self.highlight = None
        self.radiated = self.radiance
        if gloss:
            self.gloss = device.empty("panorama.gloss", texels, np.int32)
            self.highlight = device.empty("panorama.highlight", (*texels, 4))
            self.radiated = device.empty("panorama.radiated", (*texels, 4))
        self._depth = device.empty("panorama.depth", texels)
        self._normal = device.empty("panorama.normal", (*texels, 3))
        self._marks = device.empty("panorama.marks", texels, np.uint8)
        column, row = equirect_edges(self.width, self.height)
        self.column = device.upload("panorama.column", column)
        self.row = device.upload("panorama.row", row)
        azimuth, polar = equirect_centres(self.width, self.height)
        self._grid = {
            "width": self.width,
            "height": self.height,
            "column": self.column,
            "row": self.row,
            "azimuth": device.upload("panorama.azimuth", azimuth),
            "polar": device.upload("panorama.polar", polar),
        }
        self.background: Background | None = None
        if background is not None:
            self.background = Background(device, self.width, self.height, self.shape, background)
        self._build = device.kernel("world/real/surface.cl", "build_surface")
        self._pyramid = Pyramid(device)
        self.median_depth = self.nearest = self.farthest = self.mean_radiance = 0.0

    def load(self, frame: Frame) -> None:
        """Upload a video frame and build what the tracer needs of it."""
        finite = frame.depth[np.isfinite(frame.depth)]
        self.median_depth = frame.median_depth
        self.nearest = float(finite.min()) if finite.size else 0.0
        self.farthest = float(finite.max()) if finite.size else 0.0
        radiance = frame.radiance
        rows = np.sin((np.arange(frame.height) + 0.5) / frame.height * np.pi)
        self.mean_radiance = float(
            np.average(radiance.mean(axis=(1, 2), dtype=np.float64), weights=rows)
        )
        with self._device.profile.section("upload"):
            if self.outside is not None:
                environment = np.zeros(self.outside.shape, np.float32)
                environment[..., :3] = outside_radiance(radiance, frame.opening)
                self._device.write(self.outside, environment)
            self._device.write(self.color, self._texels(frame.color))
            if self.radiance is not self.color:
                self._device.write(self.radiance, self._texels(radiance))
            self._device.write(self._depth, self._enlarged(frame.depth))
            self._device.write(self._normal, self._enlarged(frame.normal))
            self._device.write(self._marks, SURFACE_OPENING * self._enlarged(frame.opening))
            if self.gloss is not None:
                diffuse = np.zeros(frame.depth.shape, np.int32)
                gloss = diffuse if frame.gloss is None else frame.gloss
                self._device.write(self.gloss, self._enlarged(gloss).astype(np.int32))
        with self._device.profile.section("surface"):
            self._build(
                (self.width, self.height),
                self._grid,
                depth=self._depth,
                normal=self._normal,
                marks=self._marks,
                surface=self.surface,
                range=self.range,
            )
        self._pyramid.run(self.range, self.shape)

    def remember(self, *, forget: bool) -> NDArray[np.float32] | None:
        """Follow with what the loaded frame hides of those before, where that is remembered.

        Parameters
        ----------
        forget : bool
            They have nothing to do with it, or were seen from elsewhere.

        Returns
        -------
        (h, w) float32 or None
            `Background.hidden_light` by texels of the frame; None where nothing can be hidden.
        """
        if self.background is None:
            return None
        background = self.background
        background.load(
            self._grid,
            depth=self._depth,
            normal=self._normal,
            marks=self._marks,
            radiance=self.radiance,
            surface=self.surface,
            range_=self.range,
            scale=self.scale,
            farthest=self.farthest,
            forget=forget,
        )
        self._pyramid.run(background.range, self.shape)
        if background.first:
            return None
        return self._device.read(background.hidden_light)[:: self._repeat, :: self._repeat]

    def _texels(self, picture: NDArray[np.float32]) -> NDArray[np.float32]:
        """A picture (h, w, 3) as float4 per texel."""
        texels = np.zeros((self.height, self.width, 4), np.float32)
        texels[..., :3] = self._enlarged(picture)
        return texels

    def _enlarged(self, image: Any) -> Any:
        if self._repeat == 1:
            return image
        return image.repeat(self._repeat, axis=0).repeat(self._repeat, axis=1)

    def arguments(self, thickness: float, thickness_ratio: float) -> dict[str, Any]:
        """`REAL_PARAMETERS` of `cl/lib/world/scene.h`, with the radiance that the frame has."""
        return {
            "real_width": self.width,
            "real_height": self.height,
            "real_levels": self.shape.levels,
            "real_range": self.range,
            "real_column": self.column,
            "real_row": self.row,
            "real_surface": self.surface,
            "real_thickness_m": thickness * self.scale,
            "real_thickness_ratio": thickness_ratio,
            "real_bias": START_BIAS * self.scale,
            "real_nearest": self.nearest,
            "real_farthest": self.farthest if self.background is None else self.background.farthest,
            "real_color": self.radiance,
            "real_outside": self.outside,
            **({} if self.background is None else self.background.arguments()),
        }

    @property
    def scale(self) -> float:
        """Length in metres of what is one metre in a room (whose median depth is two)."""
        return 0.5 * self.median_depth
