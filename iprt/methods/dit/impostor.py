"""Distance impostor: radiance and distance around a point, splatted from the panorama."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyopencl import cltypes

from iprt.device.compute import ComputeDevice
from iprt.world.real.lights import LIGHT_ROWS, Lights
from iprt.world.real.panorama import ImpostorArgs, Panorama

FACES = 6
SKY = 1e3
"""Distance of open sky as a multiple of the farthest surface's."""


class Impostor:
    """Cube map of radiance and distance around a point other than the capture centre.

    K. Rohmer, J. Jendersie, T. Grosch, "Natural Environment Illumination" (IEEE TVCG 2017), section
    6.1. `cl/lib/world/real/impostor.h` traces rays against it.

    Parameters
    ----------
    device : ComputeDevice
    side : int
        Texels along the side of a face.
    steps : int
        Iterations that refine a ray's hit.
    light_sampling : bool
        Build the table of lights, which rays are aimed at.

    Attributes
    ----------
    centre : (3,) float32
        Metres, in the axes of the capture centre.
    texels : (N, 4) float32
        Linear radiance and inverse distance in 1/m of the faces (`cl/lib/maths/cube.h`), followed
        by their coarser levels.
    inverse : (6 * side * side,) float32
        Inverse distances of the faces.
    lights : Lights or None
        Lights by direction from the centre; None without `light_sampling`.
    """

    def __init__(
        self, device: ComputeDevice, side: int, steps: int, *, light_sampling: bool
    ) -> None:
        self._device = device
        self._side, self._steps, self._farthest = side, steps, 1.0
        self.centre = np.zeros(3, np.float32)
        self._sides = [side]
        while self._sides[-1] > 1:
            self._sides.append((self._sides[-1] + 1) // 2)
        sizes = [FACES * n * n for n in self._sides]
        self._offsets = [0, *np.cumsum(sizes).tolist()]
        faces = (sizes[0],)
        self._nearest = device.empty("impostor nearest", faces, np.uint32)
        self._source = device.empty("impostor source", faces, np.uint32)
        self.texels = device.zeros("impostor texels", (self._offsets[-1], 4))
        self.inverse = device.zeros("impostor inverse distance", faces)
        file = "methods/dit/impostor.cl"
        known = {"side": side, "nearest": self._nearest, "source": self._source}
        self._splat = device.kernel(file, "splat_surfaces").fixed(known)
        self._shade = device.kernel(file, "shade_impostor").fixed(known, texels=self.texels)
        fill = "methods/dit/impostor_fill.cl"
        self._push = device.kernel(fill, "push_texels").fixed(texels=self.texels)
        self._pull = device.kernel(fill, "pull_texels").fixed(texels=self.texels)
        self.lights: Lights | None = None
        if light_sampling:
            # The resolution of the faces.
            self._rows = min(2 * side, LIGHT_ROWS)
            self.lights = Lights(device, 2 * self._rows, self._rows, name="impostor light")
            self._picture = device.empty("impostor picture", (self._rows, 2 * self._rows, 3))
            self._show = device.kernel(file, "show_impostor").fixed(
                rows=self._rows, picture=self._picture
            )

    def place(self, panorama: Panorama, centre: NDArray[np.floating]) -> None:
        """Build the map around the point `centre` (3,), in metres, from the panorama."""
        device = self._device
        self.centre = centre.astype(np.float32)
        reach = panorama.farthest + float(np.linalg.norm(centre))
        self._farthest = SKY * (reach if reach > 0.0 else 1.0)
        seen = {
            "width": panorama.width,
            "height": panorama.height,
            "real_surface": panorama.surface,
            "real_range": panorama.range,
            "color": panorama.radiated,
            "centre": self._centre(),
        }
        device.fill_zero(self._nearest)
        device.fill_zero(self._source)
        for claims in (0, 1):
            self._splat((panorama.width, panorama.height), seen, claims=claims)
        self._shade((self._side, FACES * self._side), seen)
        self.fill()
        if self.lights is not None:
            self._show((2 * self._rows, self._rows), impostor=self.arguments())
        if self.lights is not None:
            self.lights.load(self._picture)

    def fill(self) -> None:
        """Fill the holes of `texels`, marked by an inverse distance below 0, by push-pull."""
        levels = list(zip(self._sides, self._offsets, self._offsets[1:], strict=False))[:-1]
        for side, fine, coarse in levels:
            half = (side + 1) // 2
            self._push((half, FACES * half), side=side, fine=fine, coarse=coarse)
        for side, fine, coarse in reversed(levels):
            inverse = self.inverse if fine == 0 else None
            self._pull((side, FACES * side), side=side, fine=fine, coarse=coarse, inverse=inverse)

    def _centre(self) -> Any:
        return cltypes.make_float4(*self.centre, 0.0)

    def arguments(self) -> ImpostorArgs:
        """Return the map for rays."""
        return ImpostorArgs(
            texels=self.texels,
            inverse=self.inverse,
            centre=self._centre(),
            side=self._side,
            steps=self._steps,
            farthest=self._farthest,
        )
