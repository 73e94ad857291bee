"""Relighting ratio of real surfaces (IPRT, Eq. 2)."""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.gbuffer.guide import Guide, tile_arguments
from iprt.world.real.irradiance import BLACK, IrradianceCache, IrradianceCacheArgs
from iprt.world.world import World

MOST_LIT = 1e4
"""Largest ratio where objects emit light: a lamp brightens dark corners by orders of magnitude."""


class Relight:
    """Ratio of each pixel's radiance with objects to its radiance without.

    Attributes
    ----------
    ratio : (H * W, 4) float32
        Factor per color channel of the real layer's radiance, from 0 to `clamp`; row by row,
        without border. Exactly 1 where E_R and E_RV are equal, where E_R is black or not finite,
        and where no surface is lit.
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        variance: cla.Array | None,
        *,
        delta: bool,
        sun: bool,
        added_light: bool,
        clamp: float,
        name: str,
    ) -> None:
        """Build the kernel and its output.

        Parameters
        ----------
        variance : Array or None
            `Atrous.variances` of the signal, if any.
        delta : bool
            Signals are relative to a cached E_R.
        sun : bool
            There is a sun that the panorama does not show; it is not part of the cached E_R.
        added_light : bool
            Objects emit light.
        clamp : float
            Largest ratio without emission, `TraceSettings.caustic_clamp`.
        """
        self._guide = guide
        noise = variance if delta else None
        defines = guide.defines(
            DELTA=delta,
            NOISE=noise is not None,
            SUN=sun,
            ADDED_LIGHT=added_light,
            HALF_PLANES=device.half_planes,
        )
        pixels = guide.layout.width * guide.layout.height
        # A broadcast view takes no host memory, as a memory plan needs it.
        one = np.broadcast_to(np.float32(1.0), (pixels, 4))
        self.ratio = device.upload(f"{name} relighting ratio", one)
        self._kernel = device.kernel("trace/relight.cl", "relight", defines).fixed(
            guide.layout.arguments(),
            tile_arguments([guide]),
            variance=noise,
            clamp_at=MOST_LIT if added_light else clamp,
            ratio=self.ratio,
        )

    def run(
        self,
        signal: cla.Array,
        color: cla.Array,
        world: World,
        cache: IrradianceCache | None,
        touched: cla.Array,
    ) -> None:
        """Fill `ratio`.

        Parameters
        ----------
        signal : 6 planes
            `RealTracer.signal`, filtered.
        color : 3 planes
            Radiance of the real layer, L_cam.
        world : World
            The mean radiance of its panorama sets the threshold of black.
        cache : IrradianceCache or None
            E_R, if signals are relative to it.
        touched : 1 plane
            `Mask.touched`, raised where objects change the irradiance considerably. With the
            estimator "ratio", the tracer has written it already.
        """
        black = BLACK * world.panorama.mean_radiance
        known = IrradianceCacheArgs(plane=None, irradiance=None, columns=0, rows=0, black=black)
        self._kernel(
            self._guide.tiles.lanes(),
            cache=known if cache is None else cache.arguments(world.panorama),
            disc=world.panorama.sun,
            touched=touched,
            guide=self._guide.current,
            signal=signal,
            color=color,
        )
