"""Real layer of the view: the camera's picture without the objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.compositing.diffuse_part import DiffusePart
from iprt.device.block import (
    Block,
    Float2s,
    Float4s,
    Float4sOut,
    Floats,
    FloatsOut,
    Int4sOut,
    Int32,
    IntsOut,
)
from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.device.kernel_source import constant
from iprt.device.program import Define
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import CameraArgs
from iprt.gbuffer.layout import PlaneLayout
from iprt.world.real.displayed_colors import ShownArgs
from iprt.world.real.panorama import Panorama
from iprt.world.real.real_world import RealWorld

UNEVEN = constant("lib/world/real/uneven.h", "UNEVEN")
"""Value in `other_pixel` where the four texels around show several planes."""

REAL_LAYER_READS = ("surfaces", "radiance", "highlights", "color map", "camera motion")
"""Data that `RealLayer.show` reads, besides the view."""


@dataclass(kw_only=True)
class RealPlanesArgs(Block):
    """Panorama, view and planes of `cl/compositing/real_layer.cl`, which describes them."""

    width: Int32
    height: Int32
    view: Floats
    previous: Floats
    panorama_width: Int32
    panorama_height: Int32
    shown: ShownArgs
    panorama_surface: Float4s
    panorama_range: Float2s
    camera: CameraArgs
    color: FloatsOut
    normal: FloatsOut
    depth: FloatsOut
    id: FloatsOut
    motion: FloatsOut
    place: FloatsOut
    other_pixel: IntsOut
    other: Float4sOut
    corner: Int4sOut


class RealLayer:
    """Pass that resamples the panorama into the view.

    Attributes
    ----------
    color : 3 planes
        Linear radiance, L_cam of IPRT Eq. 2.
    normal, depth, id, motion : 3, 1, 1, 2 planes
        See `cl/compositing/real_layer.cl`.
    diffuse : 3 planes
        Diffuse part of `color`, in the colors for rays: `color` itself, but mapped where the frame
        has a color map, and without the highlight where real surfaces are glossy.
    other : (H * W, 4) float32, or None
        If requested: at depth edges, share of a second surface in the radiance and in the area;
        where the four texels around show several planes, their shares in the radiance.
    other_pixel : (H * W,) int32
        A pixel that shows the second surface: see `cl/compositing/real_layer.cl`.
    corner : (H * W, 4) int32, or None
        Pixels that show these texels, with `other`.
    gloss, roughness : 1 plane each, or None
        Index of the real material + 1, 0 where diffuse, and its GGX alpha, if requested.
    """

    def __init__(
        self,
        device: ComputeDevice,
        layout: PlaneLayout,
        *,
        name: str,
        gloss: bool = False,
        radiated: bool = False,
        camera: cla.Array | None = None,
        color_map: bool = False,
        clipped: bool = False,
        edges: bool = False,
    ) -> None:
        """Create planes and kernels.

        `name` prefixes buffers. `gloss`: the panorama has glossy surfaces, and the view shows their
        highlights. `radiated`: it shows diffuse radiance. `camera`: `CameraMotion.rows`, if the
        camera moves. `color_map`: frames may have one. `clipped`: frames may have clipped lights.
        `edges`: depth edges are reconstructed at the view's resolution.
        """
        self._radiated = radiated
        self._device = device
        self._layout = layout
        self.color = device.zeros(f"{name} color", layout.shape(3))
        self.normal = device.zeros(f"{name} normal", layout.shape(3))
        self.depth = device.zeros(f"{name} depth", layout.shape(1))
        self.id = device.zeros(f"{name} id", layout.shape(1))
        self.motion = device.zeros(f"{name} motion", layout.shape(2))
        self.diffuse = self.color
        self._place = device.zeros(f"{name} place", layout.shape(2))
        self._diffuse_part = DiffusePart(
            device, layout, name=name, gloss=gloss, color_map=color_map
        )
        self.gloss = self.roughness = self._highlight = None
        if gloss:
            self.gloss = device.zeros(f"{name} gloss", layout.shape(1))
            self.roughness = device.zeros(f"{name} roughness", layout.shape(1))
            self._highlight = device.zeros(f"{name} highlight", layout.shape(3))
        defines = {"CAMERA_MOTION": camera is not None, "WIDE": device.wide}
        self._camera = camera
        pixels = layout.width * layout.height
        self.other = device.zeros(f"{name} other", (pixels, 4)) if edges else None
        self.corner = device.zeros(f"{name} corner", (pixels, 4), np.int32) if edges else None
        self.other_pixel = device.zeros(f"{name} other pixel", (pixels,), np.int32)
        # Frames without clipped lights use the faster ones.
        self._plain = self._kernels(defines)
        self._clipped = self._kernels({**defines, "CLIPPED": True}) if clipped else None

    @property
    def edges(self) -> dict[str, cla.Array]:
        """Arguments for comparing objects at depth edges: see `cl/compositing/unpack.cl`."""
        assert self.other is not None
        return {
            "real_normal": self.normal,
            "real_depth": self.depth,
            "other": self.other,
            "other_pixel": self.other_pixel,
        }

    def _kernels(self, defines: Mapping[str, Define]) -> list[Kernel]:
        """Return the kernels that fill the planes, in order."""
        glossy = self.gloss is not None
        names = ["resample_glossy" if glossy else "resample_panorama"]
        names.append("resample_highlight" if glossy else "resample_color")
        if self.other is not None:
            names.append("sharpen_glossy" if glossy else "sharpen_edges")
        return [
            self._device.kernel("compositing/real_layer.cl", name, defines).fixed(
                {"gloss": self.gloss, "roughness": self.roughness, "highlight": self._highlight},
            )
            for name in names
        ]

    def run(
        self,
        panorama: Panorama,
        view: cla.Array,
        previous: cla.Array,
        *,
        real_materials: cla.Array | None = None,
        color_map: cla.Array | None = None,
    ) -> None:
        """Fill the planes.

        Parameters
        ----------
        panorama : Panorama
        view, previous : (16,) float32
            `View.kernel_constants()`.
        real_materials : (rows, 4) float32 or None
            `material_table()` of the glossy real surfaces, where there are any.
        color_map : (6, 4) or None
            `ColorMap.rows` of the frame.
        """
        gloss = {
            "panorama_gloss": panorama.gloss,
            "panorama_radiance": panorama.radiance,
            "panorama_radiated": panorama.radiated,
            "real_materials": real_materials,
        }
        shown = panorama.clipped.shown(panorama.color)
        if self._radiated:
            shown = ShownArgs(color=panorama.radiated)
        planes = RealPlanesArgs(
            width=self._layout.width,
            height=self._layout.height,
            view=view,
            previous=previous,
            panorama_width=panorama.width,
            panorama_height=panorama.height,
            shown=shown,
            panorama_surface=panorama.surface,
            panorama_range=panorama.range,
            camera=CameraArgs(rows=self._camera),
            color=self.color,
            normal=self.normal,
            depth=self.depth,
            id=self.id,
            motion=self.motion,
            place=self._place,
            other_pixel=self.other_pixel,
            other=self.other,
            corner=self.corner,
        )
        kernels = self._plain if shown.clipped is None else self._clipped
        assert kernels is not None, "no kernels for it"
        surfaces, colors, *edges = kernels
        for kernel in (surfaces, colors):
            kernel(self._layout.items(wide=self._device.wide), gloss, layer=planes)
        for kernel in edges:
            kernel(self._layout.size, gloss, layer=planes)
        self.diffuse = self._diffuse_part.run(self.color, self._highlight, color_map)

    def show(self, world: RealWorld, context: FrameContext) -> None:
        """Fill the planes with the view of the world in a frame."""
        self.run(
            world.panorama,
            context.view,
            context.previous,
            real_materials=None if world.highlight is None else world.highlight.table,
            color_map=world.color_map,
        )

    def replace_color(
        self, background: NDArray[np.float32], color_map: cla.Array | None = None
    ) -> None:
        """Use another picture (H, W, 3), linear radiance, as the camera's."""
        self._device.write(self.color, self._layout.padded(np.moveaxis(background, -1, 0)))
        self.diffuse = self._diffuse_part.run(self.color, self._highlight, color_map)
