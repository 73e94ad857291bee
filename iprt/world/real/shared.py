"""Real worlds that several views of one scene share."""

from __future__ import annotations

from collections.abc import Hashable
from weakref import WeakValueDictionary

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.settings.features import Features
from iprt.world.real.real_world import RealWorld


class RealWorlds:
    """The real worlds of a device. Each exists as long as a view uses it.

    Views that share one show the same frame of the video: what one of them loads, all of them show
    in their next frame.
    """

    def __init__(self) -> None:
        self._worlds: WeakValueDictionary[Hashable, RealWorld] = WeakValueDictionary()

    def get(self, device: ComputeDevice, frame: Frame, features: Features) -> RealWorld:
        """The world that `features` ask for, with `frame` loaded; it is made if there is none."""
        key = (device, frame.width, frame.height, frame.pose is None, features.of_real_world)
        world = self._worlds.get(key)
        if world is None:
            world = self._worlds[key] = RealWorld(device, frame, features)
        else:
            world.load(frame)
        return world
