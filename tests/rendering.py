"""Whole frames: the pictures that tests look at."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from iprt.aovs import AOVS
from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance
from iprt.renderer import RenderedFrame, Renderer
from iprt.settings.model import Settings


def render(
    device: ComputeDevice,
    frame: Frame,
    objects: Sequence[Instance],
    view: View,
    settings: Settings | None = None,
    frames: int = 1,
    aovs: Iterable[str] = tuple(AOVS),
    **others: Any,
) -> RenderedFrame:
    """A still picture, by a renderer of its own; `others` are further arguments of `Renderer`."""
    with Renderer(device, frame, objects, view, settings, **others) as renderer:
        return renderer.render(frames, aovs)
