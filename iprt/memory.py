"""Memory that a picture needs on a device, computed before allocation, and remedies."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from iprt.device.budget import amount, remedy, what_to_lower
from iprt.errors import DeviceError

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.device.program import PlannedKernel
    from iprt.footage.frame import Frame
    from iprt.footage.properties import Footage
    from iprt.geometry.camera import View
    from iprt.geometry.mesh import Instance
    from iprt.settings.features import Features
    from iprt.settings.model import Settings


@dataclass(frozen=True)
class RenderPlan:
    """Buffers and kernels of a renderer before it is created.

    Attributes
    ----------
    buffers : dict of str to int
        Bytes by name.
    kernels : tuple of PlannedKernel
    """

    view: View
    features: Features
    buffers: dict[str, int]
    kernels: tuple[PlannedKernel, ...]

    @classmethod
    def of(
        cls,
        frame: Frame,
        instances: Iterable[Instance],
        view: View,
        settings: Settings | None = None,
        footage: Footage | None = None,
        *,
        is_cpu: bool = True,
    ) -> RenderPlan:
        """Return the plan, from the renderer's own code on a device without allocations.

        `is_cpu`: the plan is for a CPU.
        """
        from iprt.device.plan import PlanDevice
        from iprt.renderer import Renderer

        device = PlanDevice(is_cpu=is_cpu)
        renderer = Renderer(device, frame, instances, view, settings, footage=footage)
        return cls(view, renderer.features, device.buffers, tuple(device.kernels))

    @property
    def bytes(self) -> int:
        """Size of all buffers together."""
        return sum(self.buffers.values())

    def problem(self, device: str, memory: int, largest: int) -> str | None:
        """Return why the plan does not fit, and a remedy; None if it fits.

        Parameters
        ----------
        device : str
            Its name.
        memory, largest : int
            Bytes that the device has, and that one buffer may have.
        """
        size = f"{self.view.width} x {self.view.height} pixels"
        if self.bytes > memory:
            return (
                f"{size} need {amount(self.bytes)} on {device}, which has {amount(memory)}: "
                f"{what_to_lower(self.buffers)}"
            )
        name = max(self.buffers, key=self.buffers.__getitem__)
        if self.buffers[name] > largest:
            return (
                f"{size} need a buffer of {amount(self.buffers[name])} ({name}) on {device}, "
                f"which allows {amount(largest)}: {remedy(name)}"
            )
        return None


def require_memory(
    device: ComputeDevice,
    frame: Frame,
    instances: Iterable[Instance],
    view: View,
    settings: Settings,
    footage: Footage | None = None,
) -> RenderPlan:
    """Return the plan of a picture, whose kernels the device begins to compile.

    Refuses a plan whose buffers do not fit into the device's memory. Drivers for CPUs report memory
    that they do not have, and the system then kills the process without a message.

    Raises
    ------
    DeviceError
    """
    plan = RenderPlan.of(frame, instances, view, settings, footage, is_cpu=device.is_cpu)
    problem = plan.problem(device.name, device.memory, device.largest_buffer)
    if problem is not None:
        raise DeviceError(problem)
    device.compile(plan.kernels)
    return plan
