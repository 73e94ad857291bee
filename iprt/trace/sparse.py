"""Base class of IPRT and related methods: sparsely traced pixels and filtered signals."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import pyopencl.array as cla

from iprt.filter.influence import VISIBLE, Change, Influence, Probes
from iprt.filter.mask import LEVEL_WAITING, Mask, Masks
from iprt.filter.temporal import Accumulated
from iprt.footage.frame import LUMINANCE, Frame
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide, Guides, Layer
from iprt.gbuffer.tiles import Tiles
from iprt.method import Image, Method, Setup, Signals, in_front
from iprt.passes import Clock, Pass
from iprt.trace.pixels import RealPixels, ReflectingPixels
from iprt.trace.tracers import RayKernels
from iprt.world.world import World

Around = tuple[cla.Array, int] | None
"""Ratio of real surfaces around the capture centre and its rows, for `World.relight`."""


class SparseMethod(Method):
    """Method that relights real surfaces, if it traces rays from them, and shades the objects.

    Attributes
    ----------
    real_pixels : RealPixels or None
        None for methods that do not relight.
    reflecting_pixels : ReflectingPixels
    """

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        device, features, gbuffer = setup.device, setup.features, setup.gbuffer
        real, objects = gbuffer.real, gbuffer.objects
        self._world: World | None = None
        self._view: cla.Array | None = None
        self._guides: list[Guide] = []
        count = 1 + features.tracing + (real.gloss is not None)
        self._tiles = Tiles(device, setup.layout, name="view", layers=count)
        self._motions: list[cla.Array] = []
        layers: list[Layer] = []
        masks: list[Mask] = []
        kernels = self.kernels()
        self.real_pixels: RealPixels | None = None
        if features.tracing:
            guide = self._guide("real", real.motion)
            motion = real.motion if features.sleeping else None
            layers.append(Layer(real.normal, real.depth, real.id, motion))
            self.real_pixels = RealPixels(device, real, guide, features, kernels.real, name="real")
            masks.append(self.real_pixels.mask)
        gloss_guide = None
        if real.gloss is not None:
            gloss_guide = self._guide("gloss", real.motion)
            motion = real.motion if features.sleeping else None
            layers.append(Layer(real.normal, real.depth, real.gloss, motion))
        guide = self._guide("object", objects.motion)
        layers.append(Layer(objects.normal, objects.depth, objects.id))
        self.reflecting_pixels = pixels = ReflectingPixels(
            device,
            real,
            objects,
            guide,
            gloss_guide,
            features,
            kernels,
        )
        if pixels.gloss_mask is not None:
            masks.append(pixels.gloss_mask)
        masks.append(pixels.mask)
        self._gather = Guides(device, self._guides, layers, objects=guide.layer)
        self._masks = Masks(device, masks)
        self._probes: Probes | None = None
        if features.sleeping:
            self._probes = Probes(device, masks[:-1], layers[:-1])
            self._influence = Influence(device, masks[:-1])

    def kernels(self) -> RayKernels:
        """Return the method's kernels; called once, when the method is built."""
        return RayKernels.of(self.setup.features)

    def _guide(self, name: str, motion: cla.Array) -> Guide:
        """Add a guide for a layer of the view."""
        setup = self.setup
        guide = Guide(
            setup.device,
            setup.layout,
            name=name,
            camera=setup.camera,
            tiles=self._tiles,
        )
        self._guides.append(guide)
        self._motions.append(motion)
        return guide

    def passes(self, world: World) -> list[Pass[FrameContext]]:
        """Return the passes: select pixels to trace, relight real ones, shade reflecting ones."""
        self._world = world
        surfaces, chosen = ("real layer", "object layer"), ("traced pixels",)
        guides = "real guide", "reflected guide"
        passes = [
            *self.prepare(world),
            Pass("guide", Clock.FRAME, lambda c: self._gather_layers(world, c), surfaces, guides),
            Pass("mask", Clock.FRAME, lambda c: self._choose(world, c), guides, chosen),
        ]
        if self.real_pixels is not None:
            passes += self.real_pixels.passes(world)
            if self.setup.features.relit_reflections:
                passes += self._relit_reflections(world, self.real_pixels.relight.ratio)
        passes += self.reflecting_pixels.passes(world)
        if self._probes is not None:
            shown, found = ("ratio", "reflected light", "real samples"), ("influence",)
            passes.append(Pass("influence", Clock.FRAME, self._measure, shown, found))
        return passes

    def _relit_reflections(self, world: World, ratio: cla.Array) -> list[Pass[FrameContext]]:
        """Return the passes that let virtual surfaces reflect relit real ones."""
        around, passes = self.relight_around(world)

        def show(context: FrameContext) -> None:
            world.relight(ratio, self.setup.view, context.view, around)

        known = ("ratio", "ratio around")
        return [*passes, Pass("relit reflections", Clock.FRAME, show, known, ("relit",))]

    def prepare(self, world: World) -> list[Pass[FrameContext]]:
        """Return the passes that prepare the scene for rays."""
        return []

    def relight_around(self, world: World) -> tuple[Around, list[Pass[FrameContext]]]:
        """Return the ratio of real surfaces outside the view and its rows, and passes that fill it.

        None: the method does not relight them.
        """
        return None, []

    def _gather_layers(self, world: World, context: FrameContext) -> None:
        """Fill the guides. A mean of all frames is one of all pixels, too."""
        wake = context.index == 0 or context.cut or not context.fading > 0.0
        least = VISIBLE * world.panorama.mean_radiance
        self._view = context.view
        self._gather.run(context.view, least=least, wake=wake)

    def _measure(self, _: FrameContext) -> None:
        """Measure the influence of the objects on the real surfaces of tiles."""
        real, pixels = self.real_pixels, self.reflecting_pixels
        assert real is not None
        relit = Change(real.samples, ratio=real.relight.ratio, color=real.layer.diffuse)
        changes = [relit]
        if pixels.gloss_mask is not None:
            changes.append(Change(pixels.gloss_samples, filtered=pixels.filtered("gloss")))
        self._influence.measure(changes)

    def _choose(self, world: World, context: FrameContext) -> None:
        """Select the pixels to trace."""
        histories = [] if self.real_pixels is None else [self.real_pixels.start(context)]
        self._masks.run(
            context.grid,
            self._motions,
            [*histories, *self.reflecting_pixels.start(context)],
            metre=world.panorama.scale,
            cut=context.cut,
        )
        if self._probes is not None:
            self._probes.place(context.view, context.index)

    @property
    def signals(self) -> Signals:
        """Signals of the last frame."""
        pixels = self.reflecting_pixels
        ratio = None if self.real_pixels is None else self.real_pixels.relight.ratio
        shown = (pixels.filtered(name) for name in ("gloss", "diffuse", "specular"))
        return Signals(ratio, *shown)

    @property
    def traced_count(self) -> cla.Array | None:
        """(1,) int32: traced pixels of real surfaces; None without any."""
        return self.real_pixels.mask.count if self.real_pixels else None

    # Auxiliary pictures -----------------------------------------------------------------------

    def aov(self, name: str) -> Image | None:
        """Return an auxiliary picture of the masks, signals or filters."""
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
        if self.real_pixels is None or self._world is None:
            return None
        cache = self._world.irradiance
        if cache is None:
            return self.read(self.real_pixels.change, slice(0, 3))
        device, guide = self.setup.device, self._every_surface()
        shown = device.zeros("irradiance shown", guide.layout.shape(3))
        cache.show(self._world.panorama, guide.arguments(), shown)
        light = self.setup.layout.image(device.read(shown), slice(0, 3))
        return self._in_the_sun(light, self._world.real.frame)

    def _in_the_sun(self, others: Image, frame: Frame) -> Image:
        """Add the sun's irradiance / π where the picture shows more than `others`, as `relight`."""
        sun, real = frame.sun, self.setup.gbuffer.real
        if sun is None or not self.setup.features.sun:
            return others
        color, normal = (
            self.setup.layout.image(self.setup.device.read(planes), slice(0, 3))
            for planes in (real.diffuse, real.normal)
        )
        facing = np.maximum(normal @ sun.seen_from(frame.pose), 0.0) / np.pi
        facing *= (color @ LUMINANCE > others @ LUMINANCE) & (others.max(axis=-1) > 0.0)
        return np.asarray(others + facing[..., None] * np.array(sun.irradiance), np.float32)

    def _every_surface(self) -> Guide:
        """Return a guide of the real surfaces in which none sleeps."""
        if self._probes is None and self.real_pixels is not None:
            return self.real_pixels.guide
        real, device = self.setup.gbuffer.real, self.setup.device
        guide = Guide(device, self.setup.layout, name="all surfaces")
        Guides(device, [guide], [Layer(real.normal, real.depth, real.id)]).run(self._view)
        return guide

    def _irradiance_mixed(self) -> Image | None:
        pixels, real = self.real_pixels, self._irradiance_real()
        if pixels is None or real is None:
            return None
        first, second = (self.read(pixels.change, part) for part in (slice(0, 3), slice(3, 6)))
        if not self.setup.features.delta or first is None or second is None:
            return second
        return np.asarray(real * (1.0 - first + second), np.float32)

    def _tracing_level(self) -> Image | None:
        level = self.read(self.real_pixels.mask.level, slice(0, 1)) if self.real_pixels else None
        # Waiting pixels send a quarter of the rays.
        return None if level is None else np.where(level == LEVEL_WAITING, np.float32(1.0), level)

    def _hit_distance(self) -> Image | None:
        distance = self.read(self.reflecting_pixels.hit, slice(0, 1))
        distance = None if distance is None else np.abs(distance)
        # Outside the objects, where no rays start, the plane holds outdated values.
        return self._in_front(distance, None)

    def _history_length(self) -> Image | None:
        def length(accumulated: Accumulated) -> Image | None:
            return self.read(accumulated.certainty, slice(1, 2))

        return self._of_signals(length, np.minimum)

    def _variance(self) -> Image | None:
        def variance(accumulated: Accumulated) -> Image | None:
            return self.read(accumulated.certainty, slice(0, 1))

        return self._of_signals(variance, np.add)

    def _of_signals(
        self, read: Callable[[Accumulated], Image | None], both: np.ufunc
    ) -> Image | None:
        """Return a picture of all signals; `both` combines diffuse and specular ones of objects."""
        signals = self.reflecting_pixels.accumulated
        virtual = functools.reduce(both, map(read, signals)) if signals else None
        accumulated = self.real_pixels.accumulated if self.real_pixels else None
        return self._in_front(virtual, read(accumulated) if accumulated else None)

    def _in_front(self, virtual: Image | None, real: Image | None) -> Image | None:
        coverage = self.read(self.setup.gbuffer.objects.coverage, slice(0, 1))
        return in_front(coverage, virtual, real)
