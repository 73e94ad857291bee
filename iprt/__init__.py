"""Insert virtual objects into 360° RGBD video, lit by the video and casting shadows into it.

The public names below are imported when they are first used, so that `import iprt` is quick.
"""

from __future__ import annotations

TYPE_CHECKING = False  # `typing` takes long to import
if TYPE_CHECKING:
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.geometry.camera import View
    from iprt.renderer import Renderer
    from iprt.scene.scene import Scene
    from iprt.settings.model import Settings
    from iprt.viewer.program.client import connect_viewer
    from iprt.viewer.program.handle import view

__version__ = "0.1.0"
__all__ = [
    "ComputeDevice",
    "Renderer",
    "Scene",
    "Settings",
    "View",
    "__version__",
    "choose_device",
    "connect_viewer",
    "view",
]

_HOMES = {
    "ComputeDevice": "iprt.device.compute",
    "Renderer": "iprt.renderer",
    "Scene": "iprt.scene.scene",
    "Settings": "iprt.settings.model",
    "View": "iprt.geometry.camera",
    "choose_device": "iprt.device.choose",
    "connect_viewer": "iprt.viewer.program.client",
    "view": "iprt.viewer.program.handle",
}


def __getattr__(name: str) -> object:
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'iprt' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
