"""The engine of a scene on a chosen device, as viewers open it."""

from __future__ import annotations

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.device.profile import SAMPLED_S
from iprt.measure.tradeoff_cache import TimedDevice, tradeoff_for
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from iprt.viewer.engine import Engine

FPS = 10.0
"""Frames per second to hold during motion, by default."""
FRAME_LIMIT_S = 60.0
"""Longest time of a frame in a viewer, seconds."""


def engine_of(scene: Scene, settings: Settings, device: str | None) -> Engine:
    """Start the engine of a scene; links out of its folder are followed if they were when opened.

    Raises
    ------
    DeviceError
        There is no such device (`choose_device`).
    """
    handle = choose_device(device)

    def make_device() -> ComputeDevice:
        compute = ComputeDevice(handle, FRAME_LIMIT_S)
        compute.profile.every_s = SAMPLED_S
        return compute

    return Engine(
        scene,
        make_device,
        settings,
        allow_outside=scene.within != scene.root,
        tradeoff=tradeoff_for(TimedDevice.of(handle)),
        render_device=device,
    )
