"""Path tracing with learned radiance of real surfaces (Lee et al. 2022)."""

from __future__ import annotations

from dataclasses import replace

from iprt.device.compute import ComputeDevice
from iprt.device.program import Define
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import plane_defines
from iprt.method import Image, Setup
from iprt.methods.oil import OilSettings
from iprt.methods.oil.learned import LearnedRadiance
from iprt.passes import Clock, Pass
from iprt.trace.paths import Environment, EnvironmentArgs, path_kernels
from iprt.trace.sparse import SparseMethod
from iprt.trace.tracers import RayKernels
from iprt.world.world import World


class LearnedEnvironment(Environment):
    """Environment with learned radiance of the real surfaces."""

    def __init__(self, device: ComputeDevice, own: OilSettings, learned: LearnedRadiance) -> None:
        super().__init__(device)
        self._learned = learned
        region = own.region if own.surfaces == "region" else False
        self._defines: dict[str, Define] = {"LEARNED_RADIANCE": True, "LOCAL_REGION": region}

    @property
    def defines(self) -> dict[str, Define]:
        """`-D` definitions of learned radiance and of the relit region."""
        return self._defines

    def arguments(self) -> EnvironmentArgs:
        """Return the environment with the learned radiance."""
        return replace(super().arguments(), learned=self._learned.arguments())


class OnlineIllumination(SparseMethod):
    """Online illumination learning (Lee et al. 2022).

    Attributes
    ----------
    environment : LearnedEnvironment
    learned : LearnedRadiance
    """

    def __init__(self, setup: Setup) -> None:
        self._own = setup.features.settings.own(OilSettings)
        self.learned = LearnedRadiance(setup.device, setup.features.settings.learning)
        self.environment = LearnedEnvironment(setup.device, self._own, self.learned)
        super().__init__(setup)
        self._show = setup.device.kernel(
            "methods/oil/show_learned.cl", "show_learned", plane_defines()
        )

    def kernels(self) -> RayKernels:
        """Return the kernels of path tracing."""
        features, bounces = self.setup.features, self._own.bounces
        return path_kernels(features, self.environment, bounces, one_pass=False)

    def prepare(self, world: World) -> list[Pass[FrameContext]]:
        """Draw samples of the frame's lights, and learn from a batch of texels in each frame."""
        seen, models = ("surfaces", "radiated"), ("models",)
        return [
            self.environment.sampling(world),
            Pass("learn", Clock.VIDEO, lambda _: self.learned.follow(world.real), seen, models),
            Pass("learn", Clock.FRAME, lambda _: self.learned.learn(world.panorama), seen, models),
        ]

    def aov(self, name: str) -> Image | None:
        """Return the learned radiance for "learned", else as `SparseMethod` does."""
        if name != "learned":
            return super().aov(name)
        if self.real_pixels is None:
            return None
        guide, device = self.real_pixels.guide, self.setup.device
        shown = device.zeros("learned shown", guide.layout.shape(3))
        self._show(
            guide.layout.size,
            guide.arguments(),
            learned=self.learned.arguments(),
            shown=shown,
        )
        return self.read(shown, slice(0, 3))
