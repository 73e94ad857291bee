"""Differential rendering: real and virtual layer become the picture (IPRT, Eq. 2)."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.gbuffer.layout import PlaneLayout


class Composite:
    """Blends relit background and objects by coverage.

    Attributes
    ----------
    picture : (H, W, 4) float32
        Linear rgb, a = coverage by objects.
    """

    def __init__(
        self,
        device: ComputeDevice,
        layout: PlaneLayout,
        *,
        relit: bool,
        diffuse: bool,
        specular: bool,
        gloss: bool = False,
        color_map: bool = False,
    ) -> None:
        """`relit`: objects shadow and light the real layer. `diffuse`, `specular`: the parts of
        which objects' radiance consists; none: no objects. `gloss`: the real layer, which is
        relit, also reflects objects. `color_map`: frames may come with one.
        """
        self._device = device
        self._layout = layout
        self._relit = relit
        self._gloss = gloss
        self._diffuse = diffuse
        self._specular = specular
        self.picture = device.empty("picture", (layout.height, layout.width, 4))
        self._kernel = self._variant(mapped=False)
        # A kernel of its own, so that frames without a map are as in a video without any.
        self._mapped = self._variant(mapped=True) if color_map else None

    def _variant(self, *, mapped: bool) -> Kernel:
        defines = {
            "HAS_RATIO": self._relit,
            "HAS_BASE": self._has_base(mapped),
            "GLOSS": self._gloss,
            "COLOR_MAP": mapped,
            "HAS_OBJECTS": self._diffuse or self._specular,
            "HAS_DIFFUSE": self._diffuse,
            "HAS_SPECULAR": self._specular,
        }
        kernel = self._device.kernel("view/composite.cl", "composite", defines)
        return kernel.fixed(self._layout.arguments(), picture=self.picture)

    def _has_base(self, mapped: bool) -> bool:
        return self._relit and (self._gloss or mapped)

    def run(
        self,
        colour: cla.Array,
        *,
        other: cla.Array,
        other_pixel: cla.Array,
        ratio: cla.Array | None = None,
        base: cla.Array | None = None,
        change: cla.Array | None = None,
        coverage: cla.Array | None = None,
        sides: cla.Array | None = None,
        albedo: cla.Array | None = None,
        diffuse: cla.Array | None = None,
        specular: cla.Array | None = None,
        color_map: cla.Array | None = None,
    ) -> None:
        """Fill `picture`.

        Parameters
        ----------
        colour : 3 planes, radiance of the real layer
        other, other_pixel : (H * W, 4), (H * W,) int32
            `RealLayer.other` and `RealLayer.other_pixel`.
        ratio : (H * W, 4), `Relight.ratio`
        base, change : 3 planes each
            `RealLayer.diffuse`, which the ratio multiplies, with gloss or a map; and what objects
            change in the reflections of real surfaces, with gloss.
        coverage : 1 plane in [0, 1], fraction of the pixel that objects cover (1 - M)
        sides : (H * W, 2)
            `VisibleLayer.sides`, with objects.
        albedo, diffuse : 3 planes each, multiplied
        specular : 3 planes, radiance
        color_map : (6, 4)
            `ColorMap.rows`: all but `colour` is in the colours that it takes the frame's to.
        """
        given = {
            "colour": colour,
            "other": other,
            "other_pixel": other_pixel,
            "ratio": ratio,
            "base": base,
            "change": change,
            "coverage": coverage,
            "sides": sides,
            "albedo": albedo,
            "diffuse": diffuse,
            "specular": specular,
            "maps": color_map,
        }
        kernel = self._kernel if color_map is None else self._mapped
        assert kernel is not None
        with self._device.profile.section("composite"):
            kernel(self._layout.size, given)
