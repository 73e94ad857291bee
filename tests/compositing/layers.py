"""The real layer of a view, as pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.compositing.real_layer import RealLayer
from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.world.real.panorama import Panorama
from tests.worlds import Float


@dataclass(frozen=True)
class Layer:
    """(H, W, 3) color and normal, (H, W) depth and id, (H, W, 2) motion; with edges, the share of
    another surface in radiance and area (H, W, 4), and the pixel that shows it (H, W).
    """

    color: Float
    normal: Float
    depth: Float
    id: Float
    motion: Float
    other: Float | None
    other_pixel: NDArray[np.int32] | None


def loaded(device: ComputeDevice, frame: Frame) -> Panorama:
    panorama = Panorama(device, frame.width, frame.height)
    panorama.load(frame)
    return panorama


def show(
    device: ComputeDevice,
    panorama: Panorama,
    view: View,
    previous: View | None = None,
    *,
    clipped: bool = False,
    edges: bool = False,
) -> Layer:
    layout = PlaneLayout.of(view)
    layer = RealLayer(device, layout, name="real", clipped=clipped, edges=edges)
    constants = (device.upload("view", v.kernel_constants()) for v in (view, previous or view))
    layer.run(panorama, *constants)

    def image(name: str) -> Float:
        planes = device.read(getattr(layer, name))
        outside = np.ones(planes.shape, bool)
        layout.interior(outside)[:] = False
        assert not planes[outside].any(), "borders hold nothing"
        channels = np.moveaxis(layout.interior(planes).astype(np.float64), 0, -1)
        return channels[..., 0] if channels.shape[-1] == 1 else channels

    planes = (image(name) for name in ("color", "normal", "depth", "id", "motion"))
    if not edges:
        return Layer(*planes, None, None)
    pixels = device.read(layer.other_pixel).reshape(view.height, view.width)
    other = device.read(layer.other).reshape(view.height, view.width, 4).astype(np.float64)
    return Layer(*planes, np.where(pixels[..., None] < 0, 0.0, other), pixels)


def no_edges(device: ComputeDevice, view: View) -> dict[str, cla.Array]:
    """`RealLayer.edges` of a view at none."""
    layout = PlaneLayout.of(view)
    layer = RealLayer(device, layout, name="no edges", edges=True)
    layer.other_pixel.fill(-1)
    return layer.edges
