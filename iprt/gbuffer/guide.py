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
from iprt.gbuffer.layout import PAD, PlaneLayout, row_items

PLANES = constant("lib/gbuffer/guide.h", "GUIDE_PLANES")
"""Normal x y z, world position x y z in metres, id (0 nothing to trace, -1 outside)."""


def plane_defines(*, equirect: bool = False, **others: Define) -> dict[str, Define]:
    """Return the build flags of every kernel that works on padded planes of a view."""
    return {"VIEW_EQUIRECT": equirect, **others}


@dataclass(kw_only=True)
class CameraArgs(Block):
    """Motion of the 360° camera (`cl/lib/gbuffer/camera.h`); `rows` of `CameraMotion`, or None."""

    rows: Floats = when("CAMERA_MOTION")


class Spans:
    """Columns of the layers of a view that have surfaces. `Guides` fills it.

    Attributes
    ----------
    rows : (layers, H, 2) int32
        First column and end of each row between which there are surfaces, or were in one of the
        last two pictures.
    past : (layers, H, 4) int32
        The same of these two alone.
    """

    def __init__(
        self, device: ComputeDevice, layout: PlaneLayout, *, name: str, layers: int = 1
    ) -> None:
        self.rows = device.zeros(f"{name} spans", (layers, layout.height, 2), np.int32)
        nothing = np.tile(np.array([layout.width, 0] * 2, np.int32), (layers, layout.height, 1))
        self.past = device.upload(f"{name} past spans", nothing)
        self._taken = 0

    def take(self) -> int:
        """Reserve one more layer and return its index."""
        self._taken += 1
        assert self._taken <= self.rows.shape[0]
        return self._taken - 1


def span_arguments(guides: Sequence[Guide]) -> dict[str, Any]:
    """Return the arguments of `SPAN_ITEM` of `cl/lib/gbuffer/batch.h`."""
    assert all(guide.spans is guides[0].spans for guide in guides)
    return {
        "spans": guides[0].spans.rows,
        **batched(layer=[guide.layer for guide in guides]),
    }


class Guide:
    """G-buffer of a layer as planes of `cl/lib/gbuffer/guide.h`, for this and the previous picture.

    `Guides` fills it.

    Attributes
    ----------
    current, previous : planes of 7 channels, float32
        Before the second picture, `previous` holds no surface.
    spans : Spans
    layer : int
        Index of its layer in `spans`.
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
        spans: Spans | None = None,
    ) -> None:
        """Create the planes.

        `name` prefixes their buffers. Layers whose passes share launches share `spans`.
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
        self.spans = spans or Spans(device, layout, name=name)
        self.layer = self.spans.take()
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
    """

    normal: cla.Array
    depth: cla.Array
    ids: cla.Array


class Guides:
    """Pass that gathers the layers of a view into their guides, and finds their spans."""

    def __init__(
        self, device: ComputeDevice, guides: Sequence[Guide], layers: Sequence[Layer]
    ) -> None:
        """Create the kernels for one layer per guide."""
        self._guides = guides
        self._row_items = row_items(device, 3, guides[0].layout.height)
        defines = guides[0].defines()
        size, spans = guides[0].layout.arguments(), span_arguments(guides)
        of_surfaces = batched(
            depth=[layer.depth for layer in layers],
            id=[layer.ids for layer in layers],
        )
        self._find_spans = device.kernel("gbuffer/guide.cl", "find_spans", defines).fixed(
            size, spans, of_surfaces, layers=len(guides), past=guides[0].spans.past
        )
        self._build = device.kernel("gbuffer/guide.cl", "build_guide", defines).fixed(
            size, spans, of_surfaces, batched(normal=[layer.normal for layer in layers])
        )

    def run(self, view: cla.Array) -> None:
        """Fill each `current` with this picture's guide, after moving the last one to `previous`.

        Parameters
        ----------
        view : (16,) float32
            `View.kernel_constants()`.
        """
        for guide in self._guides:
            guide.current, guide.previous = guide.previous, guide.current
        layout = self._guides[0].layout
        self._find_spans((*self._row_items, len(self._guides)))
        self._build(
            (*layout.size, len(self._guides)),
            batched(guide=[guide.current for guide in self._guides]),
            view=view,
        )
