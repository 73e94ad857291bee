"""Panorama on the device: everything that depends on the video frame only."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.block import Block, Float4, Float4s, Float32, Floats, Int32, when
from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.footage.sky import OUTSIDE_ROWS
from iprt.footage.window_environment import outside_radiance
from iprt.passes import Clock, Pass, Schedule
from iprt.world.real.background import Background, BackgroundArgs
from iprt.world.real.changed_surfaces import ChangedSurfaces, changed_tiles, span_of
from iprt.world.real.displayed_colors import ShownTexels
from iprt.world.real.pictures import Flux, PictureLoader
from iprt.world.real.pyramid import GridArgs, Pyramid, PyramidShape
from iprt.world.real.sun import SunArgs
from iprt.world.real.surfaces import Surfaces

if TYPE_CHECKING:
    from iprt.settings.trace import TraceSettings

COARSEST_COLUMNS = 8
"""Fewest columns of a level: cells span at most π/4 of azimuth, so that one plane per meridian
decides a crossing."""
START_BIAS = 1e-3
"""Tolerance, in metres of a room, of a ray's start against the surface it starts from."""


@dataclass(kw_only=True)
class ImpostorArgs(Block):
    """Distance impostor (`cl/lib/world/real/impostor.h`).

    Attributes
    ----------
    texels : (6 * side * side, 4) float32
        Radiance and inverse distance, 1/m.
    inverse : (6 * side * side,) float32
        Inverse distances alone.
    centre : float4
        About the capture centre, metres; 0.
    side : int
    steps : int
        Refinements of a hit.
    farthest : float
        Metres along a ray beyond which there is only open sky.
    """

    texels: Float4s
    inverse: Floats
    centre: Float4
    side: Int32
    steps: Int32
    farthest: Float32


@dataclass(kw_only=True)
class RealLayerArgs(Block):
    """Real scene for rays (`cl/lib/world/real/real.h`).

    Attributes
    ----------
    surface : (H, W, 4) float32
        Tangent planes and flags.
    thickness_m, thickness_ratio : float
        Assumed thickness of surfaces: metres, at least, and least ratio to the radial distance.
    back_faces : int
        1: back faces are assumed where the camera saw none.
    bias : float
        Metres: a start this little behind a surface counts as before it.
    nearest, farthest : float
        Smallest and largest finite depth, metres.
    color : (H, W, 3) float32
        Radiance.
    outside : (OUTSIDE_ROWS, 2 OUTSIDE_ROWS, 3) float32 or None
        Radiance seen through windows.
    sun : SunArgs
    """

    grid: GridArgs
    surface: Float4s
    thickness_m: Float32
    thickness_ratio: Float32
    back_faces: Int32
    bias: Float32
    nearest: Float32
    farthest: Float32
    color: Floats
    outside: Floats
    background: BackgroundArgs | None = when("BACKGROUND")
    impostor: ImpostorArgs | None = when("IMPOSTOR")
    sun: SunArgs = field(default_factory=SunArgs)


class Panorama:
    """Radiance, tangent planes and depth pyramid of the current video frame.

    Attributes
    ----------
    width, height : int
    color : (H, W, 3) float32
        `Frame.color`.
    radiance : (H, W, 3) float32
        `Frame.radiance`: `color` itself, or a separate buffer where the frame has a map.
    clipped : ShownTexels
        Texels of `color` with a different displayed color.
    surfaces : Surfaces
    outside : (OUTSIDE_ROWS, 2 OUTSIDE_ROWS, 3) float32 or None
        Distant environment behind windows, if requested.
    gloss : (H, W) uint8 or None
        0 where the surface is diffuse, else 1 + index of its real material, if requested.
    radiated : (H, W, 3) float32
        Radiance of real surfaces for rays: `radiance` itself, but where surfaces are glossy without
        highlights, the specular reflection towards the capture centre (`Highlight`).
    marks : (H, W) uint8
        `gloss` on the host.
    changed : ChangedSurfaces
        Where surfaces, or their gloss, have changed since `Highlight` has looked.
    changed_rows, changed_columns : (H,) bool, slice
        Where surfaces may differ from the previous frame's.
    range : (cells, 2) float32
        Min/max pyramid of radial distances, level 0 first.
    background : Background or None
        Surfaces hidden by this frame that the video has shown before, if remembered.
    median_depth, nearest, farthest : float
        Median, least and largest finite depth, in metres; `farthest` is 0 where all is open sky.
    flux : Flux
        Of `radiance`.
    """

    def __init__(
        self,
        device: ComputeDevice,
        width: int,
        height: int,
        *,
        outside: bool = False,
        gloss: bool = False,
        color_map: bool = False,
        background: TraceSettings | None = None,
    ) -> None:
        """Create the buffers.

        `color_map`: frames may have one. `background`: hidden surfaces are remembered, with the
        assumed thickness of surfaces.
        """
        # Tiny panoramas are repeated texel by texel until the coarsest cells are narrow enough.
        self._repeat = max(1, -(-COARSEST_COLUMNS // width))
        self.width, self.height = width * self._repeat, height * self._repeat
        self._device = device
        self.shape = PyramidShape.of(self.width, self.height, COARSEST_COLUMNS)
        texels = (self.height, self.width)
        self.surfaces = Surfaces(device, self.width, self.height)
        self._pictures = PictureLoader(
            device, self.width, self.height, share=device.is_cpu, color_map=color_map
        )
        self.clipped = ShownTexels(device, self.width, self.height)
        self.range = device.empty("panorama.range", (self.shape.offsets[-1], 2))
        self.outside = None
        if outside:
            self.outside = device.empty("panorama.outside", (OUTSIDE_ROWS, 2 * OUTSIDE_ROWS, 3))
        self.changed = ChangedSurfaces(self.width, self.height)
        self.changed_rows = np.ones(self.height, bool)
        self.changed_columns = slice(0, self.width)
        self.sun = SunArgs()
        self.marks = np.zeros(texels, np.uint8)
        self.gloss = self._radiated = None
        if gloss:
            self.gloss = device.zeros("panorama.gloss", texels, np.uint8)
            self._radiated = device.empty("panorama.radiated", (*texels, 3))
        self.background: Background | None = None
        if background is not None:
            self.background = Background(device, self.surfaces, self.shape, background)
        self._pyramid = Pyramid(device)
        self.flux = Flux(0.0, 0.0)
        self.median_depth = self.nearest = self.farthest = 0.0

    def passes(self) -> list[Pass[Frame]]:
        """Return the passes that load a video frame."""
        return [
            Pass("picture", Clock.VIDEO, self._load_picture, writes=("radiance",)),
            Pass("surfaces", Clock.VIDEO, self._load_surfaces, writes=("surfaces",)),
            Pass("pyramid", Clock.VIDEO, self._build_pyramid, ("surfaces",), ("pyramid",)),
            Pass("windows and gloss", Clock.VIDEO, self._load_marks, (), ("windows", "gloss")),
            Pass("flux", Clock.VIDEO, self._measure_flux, ("radiance",), ("flux",)),
        ]

    def load(self, frame: Frame) -> None:
        """Upload a video frame and build the tracer's data."""
        Schedule(self.passes(), self._device.profile).walk(frame)

    def _load_surfaces(self, frame: Frame) -> None:
        normal = None if frame.normal is None else self._enlarged(frame.normal)
        tiles, self.changed_rows, self.changed_columns = self.surfaces.load(
            self._enlarged(frame.depth),
            self._enlarged(frame.opening),
            normal,
            frame.fit_tolerance,
            self.range,
        )
        self.changed.add(tiles)
        self.median_depth = frame.median_depth
        self.nearest, self.farthest = frame.nearest, frame.farthest

    def _build_pyramid(self, _: Frame) -> None:
        self._pyramid.run(self.range, self.shape, span_of(self.changed_rows))

    def _load_marks(self, frame: Frame) -> None:
        if self.outside is not None:
            self._device.write(self.outside, self._outside(frame))
        if self.gloss is not None:
            diffuse = np.zeros(frame.depth.shape, np.uint8)
            marks = self._enlarged(diffuse if frame.gloss is None else frame.gloss)
            tiles = changed_tiles(self.marks, marks)
            if tiles.any():
                self.changed.add(tiles)
                self.marks = marks
                if self._device.is_cpu:
                    self.gloss = self._device.share("panorama.gloss", marks)
                else:
                    self._device.write(self.gloss, marks)

    def _measure_flux(self, _: Frame) -> None:
        self.flux = self._pictures.flux()

    @staticmethod
    def _outside(frame: Frame) -> NDArray[np.float32]:
        texel = np.flatnonzero(frame.opening)
        light = frame.radiance_of(frame.color.reshape(-1, 3)[texel])
        return outside_radiance(light, frame.opening, frame.sky)

    def _load_picture(self, frame: Frame) -> None:
        self.sun = SunArgs.of(frame)
        self._pictures.load(self._enlarged(frame.color), frame.color_map)
        clipped = frame.clipped
        if clipped is not None and self._repeat > 1:
            clipped = clipped.repeated(self._repeat, frame.width)
        self.clipped.load(clipped)

    def remember(self, *, forget: bool) -> None:
        """Update the background with the loaded frame, if it is remembered.

        `forget`: earlier frames are unrelated, or have another capture centre.
        """
        if self.background is None:
            return
        background = self.background
        if forget and not background.first:
            self.changed.add(None)
        rows = background.load(
            radiance=self.radiance,
            strips=self._pictures.sums,
            range_=self.range,
            scale=self.scale,
            farthest=self.farthest,
            changed=self.changed_rows,
            columns=self.changed_columns,
            forget=forget,
        )
        self._pyramid.run(background.range, self.shape, rows)

    def _enlarged(self, image: Any) -> Any:
        if self._repeat == 1:
            return image
        return image.repeat(self._repeat, axis=0).repeat(self._repeat, axis=1)

    @property
    def color(self) -> cla.Array:
        """`PictureLoader.color`."""
        return self._pictures.color

    @property
    def radiance(self) -> cla.Array:
        """`PictureLoader.radiance`."""
        return self._pictures.radiance

    @property
    def radiated(self) -> cla.Array:
        """Radiance of real surfaces for rays."""
        return self.radiance if self._radiated is None else self._radiated

    def arguments(self, trace: TraceSettings) -> RealLayerArgs:
        """Return the real scene for rays, with the radiance of the frame."""
        return RealLayerArgs(
            grid=GridArgs(
                width=self.width,
                height=self.height,
                levels=self.shape.levels,
                range=self.range,
                column=self.surfaces.grid["column"],
                row=self.surfaces.grid["row"],
            ),
            surface=self.surface,
            thickness_m=trace.thickness * self.scale,
            thickness_ratio=trace.thickness_ratio,
            back_faces=int(trace.back_faces),
            bias=START_BIAS * self.scale,
            nearest=self.nearest,
            farthest=self.farthest if self.background is None else self.background.farthest,
            color=self.radiance,
            outside=self.outside,
            background=None if self.background is None else self.background.arguments(),
            sun=self.sun,
        )

    @property
    def hidden_light(self) -> cla.Array | None:
        """`Background.hidden_light`; None without a background."""
        background = self.background
        return None if background is None or background.first else background.hidden_light

    @property
    def mean_radiance(self) -> float:
        """Mean radiance over the sphere and the three channels."""
        return self.flux.mean

    @property
    def surface(self) -> cla.Array:
        """`Surfaces.surface`."""
        return self.surfaces.surface

    @property
    def scale(self) -> float:
        """Length in metres of one metre in a room (whose median depth is two)."""
        return 0.5 * self.median_depth
