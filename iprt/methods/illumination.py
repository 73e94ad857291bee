"""Path tracing with radiance of real surfaces that is learned from the video."""

from __future__ import annotations

from functools import partial
from typing import Any

from iprt.device.compute import ComputeDevice
from iprt.device.program import Define
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import plane_defines
from iprt.methods.learning import Learner, Learning
from iprt.methods.oil import OilSettings
from iprt.methods.path_tracing import Environment, PathTraceReal, PathTraceVirtual
from iprt.methods.protocol import Image, Setup, Signals
from iprt.methods.sparse import SparseMethod, Tracers
from iprt.world.world import World


class LearnedEnvironment(Environment):
    """What paths know of the scene: also what was learned of its real surfaces.

    Attributes
    ----------
    learner : Learner
    """

    def __init__(self, device: ComputeDevice, own: OilSettings) -> None:
        super().__init__(device)
        self.learner = Learner(device, own.samples, own.models)
        region = own.region if own.surfaces == "region" else False
        self._defines: dict[str, Define] = {"LEARNED_RADIANCE": True, "LOCAL_REGION": region}

    @property
    def defines(self) -> dict[str, Define]:
        return self._defines

    def arguments(self) -> dict[str, Any]:
        return {**super().arguments(), **self.learner.arguments()}


class OnlineIllumination(SparseMethod):
    """Online illumination learning (Lee et al. 2022).

    Attributes
    ----------
    environment : LearnedEnvironment
    """

    def __init__(self, setup: Setup) -> None:
        self._own = setup.features.settings.own(OilSettings)
        self.environment = LearnedEnvironment(setup.device, self._own)
        self._version, self._left, self._metre = -1, 0, 1.0
        super().__init__(setup)
        self._show = setup.device.kernel("methods/show_learned.cl", "show_learned", plane_defines())

    def tracers(self) -> Tracers:
        shared: dict[str, Any] = {"environment": self.environment, "bounces": self._own.bounces}
        return Tracers(
            partial(PathTraceReal, one_pass=False, **shared), partial(PathTraceVirtual, **shared)
        )

    def prepare_video(self, world: World) -> None:
        real, learner = world.real, self.environment.learner
        self.environment.sample(real.lights)
        # What was learned before a cut, or before a light was switched, holds no more.
        if real.cut_version > self._version:
            learner.forget()
            self._metre = world.panorama.scale
        self._version = real.version
        learner.place(real.frame.pose)
        self._left = world.panorama.width * world.panorama.height

    def trace(self, world: World, context: FrameContext) -> Signals:
        if self._left > 0:
            self._learn(world)
        return super().trace(world, context)

    def _learn(self, world: World) -> None:
        """Learn from so many texels of the video's frame as a frame may."""
        own, learner = self._own, self.environment.learner
        self._left -= own.samples
        how = Learning(
            radius=own.search_radius * self._metre,
            metre=self._metre,
            unit=max(world.panorama.mean_radiance, 1e-20),
            forgetting=own.forgetting,
        )
        with self.setup.device.profile.section("learn"):
            learner.learn(learner.draw(world.panorama), how)

    def aov(self, name: str) -> Image | None:
        if name != "learned":
            return super().aov(name)
        if self.real_pixels is None:
            return None
        guide, device = self.real_pixels.guide, self.setup.device
        shown = device.zeros("learned shown", guide.layout.shape(3))
        self._show(
            guide.layout.size,
            guide.arguments(),
            self.environment.learner.arguments(),
            shown=shown,
        )
        return self.read(shown, slice(0, 3))
