"""Random G-buffers for the tests of image-space passes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import tracing_grids
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide, Guides, Layer
from iprt.gbuffer.layout import PAD, PlaneLayout
from iprt.gbuffer.tiles import TILE
from iprt.geometry.camera import View

Array = NDArray[np.float64]

SIZES = [(1, 1), (7, 13), (64, 48)]


@dataclass(frozen=True)
class GBuffer:
    """(3, H, W) normal, (H, W) depth and ids, with its view."""

    view: View
    normal: Array
    depth: Array
    ids: Array

    @property
    def layout(self) -> PlaneLayout:
        return PlaneLayout.of(self.view)

    @property
    def equirect(self) -> bool:
        return self.view.projection == "equirect"

    @property
    def seen_ids(self) -> Array:
        return np.where(self.depth > 0.0, self.ids, 0.0)

    @property
    def listed(self) -> NDArray[np.bool_]:
        """Pixels of tiles that show surfaces: signals are 0 elsewhere."""
        return in_tiles(self.seen_ids > 0.0)

    @property
    def position(self) -> Array:
        return np.moveaxis(self.view.directions(), -1, 0) * self.depth

    @property
    def planes(self) -> Array:
        """(7, H, W), what the guide holds."""
        return np.concatenate([self.normal, self.position, self.seen_ids[None]])

    def guide(self, device: ComputeDevice, *, pictures: int = 1) -> Guide:
        """Return the guide after so many pictures that show the same."""
        guide = Guide(device, self.layout, name="test")
        for _ in range(pictures):
            self.fill(device, guide)
        return guide

    def fill(self, device: ComputeDevice, guide: Guide) -> None:
        view = device.upload("view", self.view.kernel_constants())
        planes = (self.normal, self.depth[None], self.ids[None])
        layer = Layer(*(upload(device, self.layout, p) for p in planes))
        Guides(device, [guide], [layer]).run(view)

    def rolled(self, columns: int) -> GBuffer:
        """Return the surroundings after a turn of the view that shifts the picture's columns."""
        yaw = self.view.yaw_deg - columns * 360.0 / self.view.width
        return replace(
            self,
            view=replace(self.view, yaw_deg=yaw),
            normal=np.roll(self.normal, columns, -1),
            depth=np.roll(self.depth, columns, -1),
            ids=np.roll(self.ids, columns, -1),
        )


def in_tiles(pixels: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the pixels of all tiles that hold one of `pixels`, (H, W)."""
    height, width = pixels.shape
    rows, columns = -(-height // TILE), -(-width // TILE)
    padded = np.zeros((rows * TILE, columns * TILE), bool)
    padded[:height, :width] = pixels
    held = padded.reshape(rows, TILE, columns, TILE).any((1, 3))
    return np.kron(held, np.ones((TILE, TILE), bool))[:height, :width]


def tracing_grid(device: ComputeDevice, offset: tuple[int, int]) -> cla.Array:
    return device.upload("tracing grid", np.array(offset, np.int32))


def still_frame(device: ComputeDevice, view: cla.Array) -> FrameContext:
    """The first frame; nothing has changed."""
    return FrameContext(
        0,
        View(1, 1),
        View(1, 1),
        view,
        view,
        moved=False,
        moving=False,
        changed=False,
        fading=0.0,
        reflected_fading=0.0,
        grids=tracing_grids(device),
    )


def random_gbuffer(width: int, height: int, *, equirect: bool, seed: int = 0) -> GBuffer:
    """Two surfaces of smooth depth and normals, one of them rough in places, with holes."""
    rng = np.random.default_rng(seed)
    view = View(width, height, 20.0, 5.0)
    if equirect:  # upright, so that a turn of the view shifts columns
        view = View(width, height, 20.0, projection="equirect")
    directions = np.moveaxis(view.directions(), -1, 0)
    waves = np.einsum("kc,chw->khw", rng.normal(size=(6, 3)) * 3.0, directions)
    waves = np.sin(waves + rng.uniform(0, 6, (6, 1, 1)))
    rough = (waves[4] > 0.7) * rng.normal(size=(4, height, width)) * 0.2
    normal = -directions + 0.2 * waves[:3] + rough[:3]
    normal /= np.linalg.norm(normal, axis=0)
    depth = 2.0 + 0.3 * waves[3] + rough[3]
    depth = np.where(rng.random(depth.shape) < 0.02, 0.0, depth)
    ids = np.where(waves[5] > 0.0, 1.0, np.where(waves[5] < -0.9, 0.0, 2.0))
    return GBuffer(view, normal, depth, ids)


def flat_gbuffer(width: int, height: int) -> GBuffer:
    """A wall at right angles to the view direction, two metres away."""
    view = View(width, height)
    directions = view.directions()
    depth = 2.0 / -directions[..., 2]
    normal = np.zeros((3, height, width))
    normal[2] = 1.0
    return GBuffer(view, normal, depth, np.ones((height, width)))


def upload(device: ComputeDevice, layout: PlaneLayout, image: Array) -> cla.Array:
    """Float32 planes of a (C, H, W) image, wrapped around as kernels leave equirect ones."""
    planes = layout.padded(image.astype(np.float32))
    layout.bordered(planes)[:] = np.pad(
        layout.bordered(planes)[..., PAD:-PAD], [(0, 0), (0, 0), (PAD, PAD)], mode="wrap"
    )
    return device.upload("test planes", planes)


def read(device: ComputeDevice, layout: PlaneLayout, planes: cla.Array) -> NDArray[np.generic]:
    """(C, H, W) image of padded planes."""
    return layout.interior(device.read(planes))


def still_motion(width: int, height: int) -> Array:
    """(2, H, W) motion of a picture in which nothing moved."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.stack([x, y])
