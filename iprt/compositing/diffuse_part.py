"""Diffuse part of the radiance of real surfaces in the view."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.gbuffer.layout import PlaneLayout


class DiffusePart:
    """Pass that removes highlights, and maps to the colors for rays.

    Parameters
    ----------
    device : ComputeDevice
    layout : PlaneLayout
    name : str
        Prefix of its buffers.
    gloss : bool
        There are highlights.
    color_map : bool
        Frames may have a color map.
    """

    def __init__(
        self, device: ComputeDevice, layout: PlaneLayout, *, name: str, gloss: bool, color_map: bool
    ) -> None:
        self._layout = layout
        self._planes: cla.Array | None = None
        if gloss or color_map:
            self._planes = device.zeros(f"{name} diffuse", layout.shape(3))
            # The program of the real layer's other kernels.
            defines = {"WIDE": device.wide}
            kernel = device.kernel("compositing/real_layer.cl", "diffuse_part", defines)
            self._kernel = kernel.fixed(layout.arguments(), diffuse=self._planes)

    def run(
        self, color: cla.Array, highlight: cla.Array | None, color_map: cla.Array | None
    ) -> cla.Array:
        """Return the diffuse part (3 planes): `color` itself without highlights and map.

        Parameters
        ----------
        color : 3 planes
            Radiance of the frame.
        highlight : 3 planes or None
            Its specular part, in the colors for rays; with gloss.
        color_map : (6, 4) or None
            `ColorMap.rows`.
        """
        if self._planes is None or (highlight is None and color_map is None):
            return color
        self._kernel(self._layout.size, color=color, maps=color_map, highlight=highlight)
        return self._planes
