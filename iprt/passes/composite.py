"""Differential rendering: real and virtual layer become the picture (IPRT, Eq. 2)."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.passes.guide import plane_defines
from iprt.passes.layout import PlaneLayout


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
    ) -> None:
        """`relit`: objects shadow and light the real layer. `diffuse`, `specular`: the parts of
        which objects' radiance consists; none: no objects. `gloss`: the real layer, which is
        relit, also reflects objects.
        """
        self._device = device
        self._layout = layout
        self._relit = relit
        self._gloss = gloss
        self._diffuse = diffuse
        self._specular = specular
        defines = plane_defines(
            HAS_RATIO=relit,
            HAS_GLOSS=gloss,
            HAS_OBJECTS=diffuse or specular,
            HAS_DIFFUSE=diffuse,
            HAS_SPECULAR=specular,
        )
        self._kernel = device.kernel("composite.cl", "composite", defines)
        self.picture = device.empty("picture", (layout.height, layout.width, 4))

    def run(
        self,
        colour: cla.Array,
        *,
        ratio: cla.Array | None = None,
        base: cla.Array | None = None,
        change: cla.Array | None = None,
        coverage: cla.Array | None = None,
        albedo: cla.Array | None = None,
        diffuse: cla.Array | None = None,
        specular: cla.Array | None = None,
    ) -> None:
        """Fill `picture`.

        Parameters
        ----------
        colour : 3 planes, radiance of the real layer
        ratio : (H * W, 4), `Relight.ratio`
        base, change : 3 planes each
            `RealLayer.diffuse`, which the ratio multiplies, and what objects change in the
            reflections of real surfaces; with gloss.
        coverage : 1 plane in [0, 1], fraction of the pixel that objects cover (1 - M)
        albedo, diffuse : 3 planes each, multiplied
        specular : 3 planes, radiance
        """
        width, height = self._layout.width, self._layout.height
        parts: list[cla.Array | None] = [ratio] if self._relit else []
        if self._gloss:
            parts += [base, change]
        if self._diffuse or self._specular:
            parts.append(coverage)
        if self._diffuse:
            parts += [albedo, diffuse]
        if self._specular:
            parts.append(specular)
        with self._device.profile.section("composite"):
            self._kernel((width, height), colour, *parts, self.picture, width, height)
