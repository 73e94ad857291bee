"""Diffuse part of the radiance of real surfaces in the view."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.gbuffer.layout import PlaneLayout


class DiffusePart:
    """Takes off highlights, and goes over to the colours that rays find.

    Parameters
    ----------
    device : ComputeDevice
    layout : PlaneLayout
    name : str
        Tells layers apart.
    gloss : bool
        There are highlights.
    color_map : bool
        Frames may come with a colour map.
    """

    def __init__(
        self, device: ComputeDevice, layout: PlaneLayout, *, name: str, gloss: bool, color_map: bool
    ) -> None:
        self._layout = layout
        self._planes: cla.Array | None = None
        if gloss or color_map:
            self._planes = device.zeros(f"{name} diffuse", layout.shape(3))
            self._kernel = device.kernel("view/real_layer.cl", "diffuse_part").fixed(
                layout.arguments(), diffuse=self._planes
            )

    def run(
        self, colour: cla.Array, highlight: cla.Array | None, color_map: cla.Array | None
    ) -> cla.Array:
        """The part (3 planes), which is `colour` itself where there is nothing to be done.

        Parameters
        ----------
        colour : 3 planes
            Radiance as the frame shows it.
        highlight : 3 planes or None
            What of it is highlight, in the colours that rays find; with gloss.
        color_map : (6, 4) or None
            `ColorMap.rows`.
        """
        if self._planes is None or (highlight is None and color_map is None):
            return colour
        self._kernel(self._layout.size, colour=colour, maps=color_map, highlight=highlight)
        return self._planes
