"""Worlds that several views of one scene share on a device."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from weakref import WeakValueDictionary

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.mesh import Instance
from iprt.settings.features import Features
from iprt.world.objects.object_bvh import ObjectBvh
from iprt.world.real.real_world import RealWorld


class Worlds:
    """Real worlds and object hierarchies, each kept as long as a view uses it.

    Views that share them show the same frame of the video, and objects in the same places. Anything
    that one of them loads appears in the next frame of all.
    """

    def __init__(self) -> None:
        self._real: WeakValueDictionary[Hashable, RealWorld] = WeakValueDictionary()
        self._objects: WeakValueDictionary[Hashable, ObjectBvh] = WeakValueDictionary()

    def real(self, device: ComputeDevice, frame: Frame, features: Features) -> RealWorld:
        """Return the world for `features` with `frame` loaded, created if missing."""
        key = (device, frame.width, frame.height, frame.pose is None, features.of_real_world)
        world = self._real.get(key)
        if world is None:
            world = self._real[key] = RealWorld(device, frame, features)
        else:
            world.load(frame)
        return world

    def hierarchy(self, device: ComputeDevice, instances: Sequence[Instance]) -> ObjectBvh:
        """Return the hierarchy of these objects, at any position, created if missing.

        Deforming meshes have one per view, because it holds the displacement of each vertex since
        the view's last frame.
        """
        if any(instance.mesh.deforms for instance in instances):
            return ObjectBvh(device, instances)
        key = (device, tuple(id(instance.mesh) for instance in instances))
        found = self._objects.get(key)
        if found is None:
            found = self._objects[key] = ObjectBvh(device, instances)
        return found
