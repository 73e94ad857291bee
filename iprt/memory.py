"""How much memory of a device a picture needs, before any is allocated, and what to lower."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from iprt.errors import DeviceError

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.device.plan import PlannedKernel
    from iprt.requirements import Requirements
    from iprt.scene.camera import View
    from iprt.scene.footage import Footage
    from iprt.scene.frame import Frame
    from iprt.scene.mesh import Instance
    from iprt.settings import Settings

REMEDIES = {
    "panorama.": "use a smaller panorama",
    "light ": "use a smaller panorama",
    "glossy texels": "use a smaller panorama",
    "highlight ": "use a smaller panorama",
    "equirect layer": "use a smaller panorama",
    "irradiance": "lower irradiance.rows",
    "ratio map": "lower trace.ratio_rows",
    "bvh ": "use simpler meshes and textures",
}
"""How the names of buffers start -> what makes them smaller; all others have the picture's size."""
PICTURE = "lower --size"
WORTH_NAMING = 0.1
"""Share of the whole from which on lowering something helps."""


@dataclass(frozen=True)
class RenderPlan:
    """What a renderer would build.

    Attributes
    ----------
    view : View
    requirements : Requirements
    buffers : dict of str to int
        Bytes by name.
    kernels : tuple of (file, kernel, defines)
        As `ComputeDevice.kernel` takes them.
    """

    view: View
    requirements: Requirements
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
    ) -> RenderPlan:
        """By the renderer's own code, on a device that allocates nothing; see `Renderer`."""
        from iprt.device.plan import PlanDevice
        from iprt.renderer import Renderer

        device = PlanDevice()
        renderer = Renderer(device, frame, instances, view, settings, footage=footage)
        return cls(view, renderer.requirements, device.buffers, tuple(device.kernels))

    @property
    def bytes(self) -> int:
        """All buffers together."""
        return sum(self.buffers.values())

    def problem(self, device: str, memory: int, largest: int) -> str | None:
        """Why it does not fit, and what to lower; None if it does.

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
    """The plan of a picture; refuse one whose buffers do not fit into the device's memory.

    Drivers for processors promise memory that they do not have, and the system then ends the
    process without a word.

    Raises
    ------
    DeviceError
    """
    plan = RenderPlan.of(frame, instances, view, settings, footage)
    problem = plan.problem(device.name, device.memory, device.largest_buffer)
    if problem is not None:
        raise DeviceError(problem)
    return plan


def remedy(buffer: str) -> str:
    """What makes the buffer of that name smaller."""
    return next((what for start, what in REMEDIES.items() if buffer.startswith(start)), PICTURE)


def what_to_lower(buffers: Mapping[str, int]) -> str:
    """What takes most of the memory, and how to make it smaller, in words."""
    shares: dict[str, int] = {}
    for name, size in buffers.items():
        shares[remedy(name)] = shares.get(remedy(name), 0) + size
    ranked = sorted(shares.items(), key=lambda share: -share[1])
    named = [entry for entry in ranked if entry[1] >= WORTH_NAMING * sum(buffers.values())]
    return " or ".join(f"{what} ({amount(size)})" for what, size in named) or PICTURE


def amount(size: int) -> str:
    """Bytes as people say them."""
    return f"{size / 2**30:.1f} GiB" if size >= 2**30 else f"{size / 2**20:.0f} MiB"
