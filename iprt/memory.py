"""Whether a device can hold what a picture needs, before any of it is allocated."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from iprt.errors import DeviceError

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.scene.camera import View
    from iprt.scene.frame import Frame
    from iprt.scene.mesh import Instance
    from iprt.settings import Settings


def require_memory(
    device: ComputeDevice,
    frame: Frame,
    instances: Iterable[Instance],
    view: View,
    settings: Settings,
) -> None:
    """Refuse a picture whose buffers do not fit into the device's memory.

    Drivers for processors promise memory that they do not have, and the system then ends the
    process without a word.

    Raises
    ------
    DeviceError
    """
    from iprt.device.plan import PlanDevice
    from iprt.renderer import Renderer

    plan = PlanDevice()
    Renderer(plan, frame, instances, view, settings)
    need, have = sum(plan.buffers.values()), device.device.global_mem_size
    if need > have:
        raise DeviceError(
            f"{view.width} x {view.height} pixels need {need / 2**30:.1f} GiB on {device.name}, "
            f"which has {have / 2**30:.1f} GiB: make the picture smaller"
        )
