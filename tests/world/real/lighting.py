"""Device functions of `cl/lib/world/path.h` that look at real scenes, called from Python."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.vectors import int4
from iprt.footage.frame import Frame
from iprt.footage.properties import Footage
from iprt.geometry.camera import View
from iprt.geometry.material import Material, material_table
from iprt.settings.features import Features
from iprt.world.objects.object_bvh import ObjectsArgs
from iprt.world.objects.object_layers import EMPTY, ObjectLayerArgs
from iprt.world.real.lights import Lights
from iprt.world.real.panorama import Panorama
from iprt.world.real.pyramid import GridArgs
from iprt.world.world import World
from tests.kernels.wrap import evaluate
from tests.variants import variant

NO_LAYER = ObjectLayerArgs(
    grid=GridArgs(width=1, height=1, levels=1, range=None, column=None, row=None),
    planes=None,
    geometry=None,
    material=None,
    footprint=1.0,
)
"""In place of the objects' layers, which these functions do not look at."""


def uploaded(device: ComputeDevice, color: NDArray[np.floating]) -> cla.Array:
    """A picture (H, W, 3) as `Panorama.radiance` holds it."""
    return device.upload("picture", color.astype(np.float32))


class RealWorld:
    """A frame without objects, as `cl/lib/world/path.h` sees it."""

    def __init__(
        self,
        device: ComputeDevice,
        frame: Frame,
        *,
        before: Frame | None = None,
    ) -> None:
        """`before` was seen first, and is remembered where `frame` hides it."""
        self._device = device
        settings = variant("ratio", objects="layers")
        self._features = Features.of(
            [Material()],
            View(1, 1),
            settings,
            Footage.of(frame, static_camera=before is not None),
        )
        self.panorama = Panorama(
            device,
            frame.width,
            frame.height,
            outside=self._features.opening_environment,
            background=settings.trace if before is not None else None,
        )
        for shown in (frame,) if before is None else (before, frame):
            self.panorama.load(shown)
            self.panorama.remember(forget=False)
        self.lights = Lights(device, frame.width, frame.height)
        self.lights.load(self.panorama.radiance, self.panorama.hidden_light)
        objects = SimpleNamespace(
            arguments=lambda view: ObjectsArgs(
                bounds=None,
                count=0,
                screen=NO_LAYER,
                equirect=NO_LAYER,
                view=view,
                rectangle=int4(EMPTY),
            ),
            materials=device.upload("materials", material_table([Material()])),
        )
        real = SimpleNamespace(
            panorama=self.panorama, lights=self.lights, highlight=None, irradiance=None
        )
        self._world = World(real, objects)

    def run(
        self,
        body: str,
        inputs: Mapping[str, NDArray[Any]],
        outputs: Mapping[str, str],
    ) -> dict[str, NDArray[Any]]:
        """`evaluate` with a variable `world`."""
        world = self._world.arguments(self._features, None)
        return evaluate(
            self._device,
            ["world/path.h"],
            body,
            inputs,
            outputs,
            defines=[
                name if value is True else f"{name}={value}"
                for name, value in self._features.trace_defines().items()
                if value is not False
            ],
            parameters="const World world",
            arguments={"world": world},
        )


def numbers(seed: int, count: int, width: int) -> NDArray[np.float32]:
    """(count, width) uniform in [0, 1)."""
    return np.random.default_rng(seed).random((count, width), np.float32)
