"""Guide: features by which image-space passes compare pixels, of this and the previous picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl.array as cla

from iprt.device.block import Block, Floats, when
from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant
from iprt.device.program import Define
from iprt.gbuffer.batch import batched
from iprt.gbuffer.layout import PAD, PlaneLayout
from iprt.gbuffer.tiles import Tiles

PLANES = constant("lib/gbuffer/guide.h", "GUIDE_PLANES")
"""Normal x y z, world position x y z in metres, id (0 nothing to trace, -1 outside)."""


def plane_defines(*, equirect: bool = False, **others: Define) -> dict[str, Define]:
    """Return the build flags of every kernel that works on padded planes of a view."""
    return {"VIEW_EQUIRECT": equirect, **others}


@dataclass(kw_only=True)
class CameraArgs(Block):
    """Motion of the 360° camera (`cl/lib/gbuffer/camera.h`); `rows` of `CameraMotion`, or None."""

    rows: Floats = when("CAMERA_MOTION")


def tile_arguments(guides: Sequence[Guide]) -> dict[str, Any]:
    """Return the arguments of `TILE_ITEM` of `cl/lib/gbuffer/batch.h`."""
    assert all(guide.tiles is guides[0].tiles for guide in guides)
    return {
        "tiles": guides[0].tiles.lists,
        **batched(layer=[guide.layer for guide in guides]),
    }


class Guide:
    """G-buffer of a layer as planes of `cl/lib/gbuffer/guide.h`, for this and the previous picture.

    `Guides` fills it.

    Attributes
    ----------
    current, previous : planes of 7 channels, float32
        Before the second picture, `previous` holds no surface.
    tiles : Tiles
    layer : int
        Index of its layer in `tiles`.
    camera : (12,) float32 or None
        `CameraMotion.rows`, from the axes of `current` to the axes of `previous`; None: equal axes.
    """

    def __init__(
        self,
        device: ComputeDevice,
        layout: PlaneLayout,
        *,
        name: str,
        camera: cla.Array | None = None,
        tiles: Tiles | None = None,
    ) -> None:
        """Create the planes.

        `name` prefixes their buffers. Layers whose passes share launches share `tiles`.
        """
        self.layout = layout
        self.camera = camera
        nothing = np.zeros(layout.shape(PLANES), np.float32)
        nothing[-1] = -1.0
        # In equirect views every row has neighbours to the left and right.
        columns = slice(None) if layout.equirect else slice(PAD, -PAD)
        layout.bordered(nothing)[-1, PAD:-PAD, columns] = 0.0
        self.current = device.upload(f"{name} guide", nothing)
        self.previous = device.upload(f"{name} guide before", nothing)
        self.tiles = tiles or Tiles(device, layout, name=name)
        self.layer = self.tiles.take()
        self._wide = device.wide

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of the layout, and `guide` of this picture."""
        return {**self.layout.arguments(), "guide": self.current}

    def defines(self, **others: Define) -> dict[str, Define]:
        """Return the build flags of every kernel that works on planes of this layout."""
        narrow = self.layout.equirect and self.layout.width < PAD
        return {"VIEW_NARROW": narrow, "WIDE": self._wide, **others}

    @property
    def camera_define(self) -> dict[str, Define]:
        """Return the `-D` variant of kernels that compare `current` with `previous`."""
        return {"CAMERA_MOTION": self.camera is not None}

    @property
    def camera_argument(self) -> dict[str, Any]:
        """Return the argument `camera` of these kernels."""
        return {"camera": CameraArgs(rows=self.camera)}


@dataclass(frozen=True)
class Layer:
    """Source planes of a guide.

    Attributes
    ----------
    normal : 3 planes
        World-space unit normals.
    depth : 1 plane
        Radial metres, 0 = no surface.
    ids : 1 plane
        0 = nothing to trace; surfaces of different ids never mix.
    motion : 2 planes or None
        Previous position of each pixel's surface in pixels, -1e9 = nowhere. With it, tiles on which
        objects have no visible influence may sleep.
    """

    normal: cla.Array
    depth: cla.Array
    ids: cla.Array
    motion: cla.Array | None = None


class Guides:
    """Pass that lists the tiles of the layers of a view, and gathers these into their guides."""

    def __init__(
        self,
        device: ComputeDevice,
        guides: Sequence[Guide],
        layers: Sequence[Layer],
        *,
        objects: int = 0,
    ) -> None:
        """Create the kernels for one layer per guide.

        `objects` is the layer of the objects: tiles of other layers around them never sleep.
        """
        self._guides = guides
        self._tiles = tiles = guides[0].tiles
        defines = guides[0].defines()
        size, listed = guides[0].layout.arguments(), tile_arguments(guides)
        of_surfaces = batched(
            depth=[layer.depth for layer in layers],
            id=[layer.ids for layer in layers],
        )
        self._scan = device.kernel("gbuffer/guide.cl", "scan_tiles", defines).fixed(
            size, listed, of_surfaces, seen=tiles.seen
        )
        motions = [layer.depth if layer.motion is None else layer.motion for layer in layers]
        self._list = device.kernel("gbuffer/guide.cl", "list_tiles", defines).fixed(
            size,
            listed,
            of_surfaces,
            batched(motion=motions, sleeps=[layer.motion is not None for layer in layers]),
            objects=objects,
            seen=tiles.seen,
            states=tiles.states,
        )
        self._build = device.kernel("gbuffer/guide.cl", "build_guide", defines).fixed(
            size,
            listed,
            of_surfaces,
            batched(normal=[layer.normal for layer in layers]),
            states=tiles.states,
        )

    def run(self, view: cla.Array, *, least: float = 0.0, wake: bool = True) -> None:
        """Fill each `current` with this picture's guide, after moving the last one to `previous`.

        Parameters
        ----------
        view : (16,) float32
            `View.kernel_constants()`.
        least : float
            Influence of objects that is visible, as a change of radiance.
        wake : bool
            No tile sleeps in this picture.
        """
        for guide in self._guides:
            guide.current, guide.previous = guide.previous, guide.current
        tiles, entries = self._tiles, len(self._guides)
        tiles.influence, tiles.before = tiles.before, tiles.influence
        self._scan((tiles.across, self._guides[0].layout.height, entries))
        self._list(
            (tiles.across, tiles.down, entries),
            before=tiles.before,
            influence=tiles.influence,
            least=least,
            wake=wake,
        )
        self._build(
            tiles.lanes(entries),
            batched(guide=[guide.current for guide in self._guides]),
            view=view,
        )
