"""Path tracing with next event estimation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray
from pyopencl import cltypes

from iprt.device.block import Block, Float4, Float4s, Int32, when
from iprt.device.compute import ComputeDevice
from iprt.device.program import Define
from iprt.gbuffer.context import FrameContext
from iprt.geometry.camera import View
from iprt.method import Setup
from iprt.passes import Clock, Pass
from iprt.settings.features import Features
from iprt.settings.path_tracing import PathTracingSettings
from iprt.trace.sparse import SparseMethod
from iprt.trace.tracers import RayKernel, RayKernels
from iprt.world.real.lights import Lights
from iprt.world.real.radiance_models import LearnedArgs
from iprt.world.world import World

FOOT_MARGIN, FOOT_HEIGHT = 0.5, 0.1
"""Region around the objects' lowest box whose real surfaces the plane is fitted to: beyond its
sides by the first share of their length, above and below its bottom by the second of its diagonal.
"""
PLANE_ROWS = 256
"""Rows of depth texels in the fit: at least this number, and less than twice as many."""
FEWEST_POINTS = 16
"""Least number of points for a fit."""


@dataclass(kw_only=True)
class EnvironmentArgs(Block):
    """Data prepared for paths (`cl/lib/trace/paths.h`).

    Attributes
    ----------
    count : int
        Number of samples.
    samples : (count, 4) float32
        See `cl/trace/environment_samples.cl`.
    plane : float4
        `Environment.plane`.
    learned : LearnedArgs or None
        Radiance of real surfaces.
    """

    count: Int32
    samples: Float4s
    plane: Float4
    learned: LearnedArgs | None = when("LEARNED_RADIANCE")


class Environment:
    """Data prepared for paths: samples of the environment's light, and the supporting plane.

    Attributes
    ----------
    plane : (4,) float32
        Unit normal n, upwards, and offset n · p in metres, in the axes of the capture centre.
    """

    def __init__(self, device: ComputeDevice) -> None:
        self._device = device
        self._kernel = device.kernel("trace/environment_samples.cl", "environment_samples")
        self._samples: cla.Array | None = None
        self._count = 0
        self.plane = np.array([0.0, 1.0, 0.0, 0.0], np.float32)

    def sampling(self, world: World) -> Pass[FrameContext]:
        """Return the pass that draws samples of the lights."""
        samples = ("light samples",)
        return Pass(
            "lights", Clock.VIDEO, lambda _: self.sample(world.real.lights), ("lights",), samples
        )

    def sample(self, lights: Lights | None) -> None:
        """Draw as many samples as the table of lights has cells."""
        if lights is None:
            return
        cells = lights.rows * lights.columns
        if self._samples is None:
            self._samples = self._device.zeros("environment samples", (cells, 4))
        self._count = cells
        self._kernel(
            (cells,), lights=lights.arguments(), samples_count=cells, samples=self._samples
        )

    @property
    def defines(self) -> dict[str, Define]:
        """`-D` definitions of path tracing kernels that use this environment."""
        return {}

    def arguments(self) -> EnvironmentArgs:
        """Return the data for paths."""
        return EnvironmentArgs(
            count=self._count, samples=self._samples, plane=cltypes.make_float4(*self.plane)
        )


def support_plane(depth: NDArray[np.float32], bounds: NDArray[np.float32]) -> NDArray[np.float32]:
    """Fit the plane that the lowest object stands on, by least squares.

    Parameters
    ----------
    depth : (H, W) float32
        Metres from the capture centre; +inf: open sky.
    bounds : (N, 2, 4) float32
        Lower and upper corner of each object's box; at least one box.

    Returns
    -------
    (4,) float32
        Unit normal n, upwards, and offset n · p in metres. If the surfaces around the box are too
        few or too steep, the plane is horizontal, through the bottom of the box.
    """
    low, high = bounds[np.argmin(bounds[:, 0, 1])][:, :3].astype(np.float64)
    margin = FOOT_MARGIN * (high - low)
    margin[1] = FOOT_HEIGHT * np.linalg.norm(high - low)
    low, high = low - margin, np.array([high[0], low[1], high[2]]) + margin
    step = max(depth.shape[0] // PLANE_ROWS, 1)
    directions = _directions(depth.shape[1], depth.shape[0], step)
    depth = depth[::step, ::step]
    seen = np.isfinite(depth)
    points = directions[seen] * depth[seen][:, None]
    near = points[((points >= low) & (points <= high)).all(axis=1)]
    middle, normal = 0.5 * (low + high), np.array([0.0, 1.0, 0.0])
    if len(near) >= FEWEST_POINTS:
        fitted = near.mean(axis=0)
        steepest = np.linalg.svd(near - fitted, full_matrices=False)[2][2]
        if abs(steepest[1]) > np.sqrt(0.5):
            middle, normal = fitted, steepest * np.sign(steepest[1])
    return np.array([*normal, normal @ middle], np.float32)


@lru_cache(maxsize=1)
def _directions(columns: int, rows: int, step: int) -> NDArray[np.float64]:
    """Return the directions of every `step`-th row and column of an equirect picture."""
    view = View(columns, rows, projection="equirect")
    return view.directions()[::step, ::step].astype(np.float64)


def path_kernels(
    features: Features, environment: Environment, bounces: int, *, one_pass: bool
) -> RayKernels:
    """Return the kernels of path tracing, of at most `bounces` reflections.

    With `one_pass`, each path from a real surface is traced with and without the objects. Otherwise
    only paths that hit objects are traced on.
    """

    def scene(world: World, view: cla.Array) -> dict[str, Any]:
        lit = environment.arguments()
        return {"world": world.arguments(features, view), "environment": lit}

    defines = {
        **features.trace_defines(),
        "MAX_BOUNCES": bounces,
        "LIGHT_SAMPLING": features.light_sampling,
        **environment.defines,
    }
    return replace(
        RayKernels.of(features),
        real=RayKernel("trace/path_trace_real", {**defines, "ONE_PASS": one_pass}, scene),
        virtual=RayKernel("trace/path_trace_virtual", defines, scene, finds_hit=False),
    )


class PathTracing(SparseMethod):
    """Base class of path tracing methods.

    Attributes
    ----------
    own : subclass of PathTracingSettings
        The method's own settings.
    one_pass : bool
        Each path is traced with and without the objects.
    environment : Environment
    """

    own: type[PathTracingSettings]
    one_pass: bool

    def __init__(self, setup: Setup) -> None:
        self.environment = Environment(setup.device)
        self._own = setup.features.settings.own(self.own)
        super().__init__(setup)

    def kernels(self) -> RayKernels:
        """Return the kernels of path tracing."""
        features, bounces = self.setup.features, self._own.bounces
        return path_kernels(features, self.environment, bounces, one_pass=self.one_pass)

    def prepare(self, world: World) -> list[Pass[FrameContext]]:
        """Draw samples of the frame's lights; fit the supporting plane, if only it is relit."""
        passes = [self.environment.sampling(world)]
        if self._own.surfaces == "plane":

            def fit(_: FrameContext) -> None:
                self.environment.plane = support_plane(world.real.frame.depth, world.objects.bounds)

            passes.append(Pass("support plane", Clock.MOTION, fit, (), ("support plane",)))
        return passes
