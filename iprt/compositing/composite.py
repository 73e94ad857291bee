"""Differential rendering: composition of the real and virtual layer (IPRT, Eq. 2)."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.gbuffer.layout import PlaneLayout


class Composite:
    """Pass that blends the relit background and the objects by coverage.

    Attributes
    ----------
    picture : (H, W, 4) float32
        Linear rgb, a = coverage by objects.
    """

    def __init__(self, device: ComputeDevice, layout: PlaneLayout) -> None:
        self._layout = layout
        self.picture = device.empty("picture", (layout.height, layout.width, 4))
        self._kernel = device.kernel("compositing/composite.cl", "composite").fixed(
            layout.arguments(), picture=self.picture
        )

    def run(
        self,
        color: cla.Array,
        *,
        other: cla.Array,
        other_pixel: cla.Array,
        corner: cla.Array,
        ratio: cla.Array | None = None,
        base: cla.Array | None = None,
        change: cla.Array | None = None,
        coverage: cla.Array | None = None,
        sides: cla.Array | None = None,
        albedo: cla.Array | None = None,
        metallic: cla.Array | None = None,
        diffuse: cla.Array | None = None,
        specular: cla.Array | None = None,
        emission: cla.Array | None = None,
        color_map: cla.Array | None = None,
    ) -> None:
        """Fill `picture`. Arguments that are None have no effect.

        Parameters
        ----------
        color : 3 planes, radiance of the real layer
        other, other_pixel, corner : (H * W, 4), (H * W,) int32, (H * W, 4) int32
            As in `RealLayer`.
        ratio : (H * W, 4), `Relight.ratio`
        base, change : 3 planes each
            `RealLayer.diffuse`, multiplied by the ratio, with gloss or a map; and the change by
            objects of reflections in real surfaces, with gloss.
        coverage : 1 plane in [0, 1], fraction of the pixel that objects cover (1 - M)
        sides : (H * W, 2)
            `VisibleLayer.sides`, with objects.
        albedo, diffuse : 3 planes each, multiplied
        metallic : 1 plane, share of objects' surfaces without diffuse reflection
        specular, emission : 3 planes each, radiance
        color_map : (6, 4)
            `ColorMap.rows`: all but `color` is in the reference's colors.
        """
        based = ratio is not None and (change is not None or color_map is not None)
        self._kernel(
            self._layout.size,
            color=color,
            other=other,
            other_pixel=other_pixel,
            corner=corner,
            ratio=ratio,
            base=base if based else None,
            change=change,
            maps=color_map,
            coverage=coverage,
            sides=sides,
            albedo=albedo,
            metallic=metallic,
            diffuse=diffuse,
            specular=specular,
            emission=emission,
        )
