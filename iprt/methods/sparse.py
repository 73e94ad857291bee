"""What IPRT and its relatives have in common: sparse samples of two kinds of pixels, filtered."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import pyopencl.array as cla

from iprt.filter.temporal import Accumulated
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide
from iprt.methods.pixels import RealPixels, VirtualPixels
from iprt.methods.protocol import Image, Method, Setup, Signals, in_front
from iprt.world.world import World


class SparseMethod(Method):
    """Relights real surfaces, where rays are traced at all, and then shades the objects.

    Attributes
    ----------
    real_pixels : RealPixels or None
    virtual_pixels : VirtualPixels
    """

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        features = setup.features
        self._world: World | None = None
        self.real_guide = self.real_pixels = None
        if features.tracing:
            self.real_guide = self._guide("real")
            self.real_pixels = RealPixels(
                setup.device, setup.gbuffer.real, self.real_guide, features, name="real"
            )
        self.virtual_pixels = VirtualPixels(
            setup.device,
            setup.gbuffer.objects,
            setup.layout,
            features,
            equirect=setup.equirect,
            camera=setup.camera,
        )

    def _guide(self, name: str) -> Guide:
        setup = self.setup
        return Guide(
            setup.device, setup.layout, equirect=setup.equirect, name=name, camera=setup.camera
        )

    def trace(self, world: World, context: FrameContext) -> Signals:
        self._world = world
        ratio = self.relight(world, context)
        change = self.reflect(world, context)
        self.virtual_pixels.run(world, context)
        reflected = self.virtual_pixels.reflected
        return Signals(ratio, change, reflected.get("diffuse"), reflected.get("specular"))

    def relight(self, world: World, context: FrameContext) -> cla.Array | None:
        """What objects do to real surfaces (`Signals.ratio`); virtual ones may reflect it."""
        if self.real_pixels is None or self.real_guide is None:
            return None
        real = self.setup.gbuffer.real
        self.real_guide.run(context.view, real.normal, real.depth, real.id)
        ratio = self.real_pixels.run(world, context)
        if self.setup.features.relit_reflections:
            around = self.relight_around(world, context)
            world.relight(ratio, self.setup.view, context.view, around)
        return ratio

    def relight_around(self, world: World, context: FrameContext) -> tuple[cla.Array, int] | None:
        """The same beside the view, as `World.relight` takes it; None: it is not known there."""
        return None

    def reflect(self, world: World, context: FrameContext) -> cla.Array | None:
        """What glossy real surfaces reflect of objects (`Signals.change`)."""
        return None

    @property
    def traced_count(self) -> cla.Array | None:
        return self.real_pixels.mask.count if self.real_pixels else None

    # Auxiliary pictures -----------------------------------------------------------------------

    def aov(self, name: str) -> Image | None:
        pictures: dict[str, Callable[[], Image | None]] = {
            "irradiance_real": self._irradiance_real,
            "irradiance_mixed": self._irradiance_mixed,
            "tracing_level": self._tracing_level,
            "hit_distance": self._hit_distance,
            "history_length": self._history_length,
            "variance": self._variance,
        }
        return pictures[name]() if name in pictures else None

    def _irradiance_real(self) -> Image | None:
        if self.real_pixels is None or self.real_guide is None or self._world is None:
            return None
        cache = self._world.irradiance
        if cache is None:
            return self.read(self.real_pixels.change, slice(0, 3))
        return self.read(cache.show(self._world.panorama, self.real_guide), slice(0, 3))

    def _irradiance_mixed(self) -> Image | None:
        pixels, real = self.real_pixels, self._irradiance_real()
        if pixels is None or real is None:
            return None
        first, second = (self.read(pixels.change, part) for part in (slice(0, 3), slice(3, 6)))
        if not self.setup.features.delta or first is None or second is None:
            return second
        return np.asarray(real * (1.0 - first + second), np.float32)

    def _tracing_level(self) -> Image | None:
        return self.read(self.real_pixels.mask.level, slice(0, 1)) if self.real_pixels else None

    def _hit_distance(self) -> Image | None:
        distance = self.read(self.virtual_pixels.hit, slice(0, 1))
        # Beside objects, where no rays start, the plane holds what was there before.
        return self._in_front(distance, None)

    def _history_length(self) -> Image | None:
        def length(accumulated: Accumulated) -> Image | None:
            return self.read(accumulated.length, slice(0, 1))

        return self._of_signals(length, np.minimum)

    def _variance(self) -> Image | None:
        def variance(accumulated: Accumulated) -> Image | None:
            return self.read(accumulated.variance, slice(0, 1))

        return self._of_signals(variance, np.add)

    def _of_signals(
        self, read: Callable[[Accumulated], Image | None], both: np.ufunc
    ) -> Image | None:
        """A picture of all signals; `both` joins those of diffuse and specular light of objects."""
        signals = self.virtual_pixels.accumulated
        virtual = functools.reduce(both, map(read, signals)) if signals else None
        accumulated = self.real_pixels.accumulated if self.real_pixels else None
        return self._in_front(virtual, read(accumulated) if accumulated else None)

    def _in_front(self, virtual: Image | None, real: Image | None) -> Image | None:
        coverage = self.read(self.setup.gbuffer.objects.coverage, slice(0, 1))
        return in_front(coverage, virtual, real)
