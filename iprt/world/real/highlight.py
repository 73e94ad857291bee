"""Separation of highlights on glossy real surfaces from the captured radiance, per video frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.block import Block, Bytes, Float2, Float4s, Int32
from iprt.device.compute import ComputeDevice
from iprt.device.kept import WORTH_KEEPING, Arrays, kept
from iprt.device.kernel import Kernel
from iprt.device.kernel_source import constant
from iprt.device.vectors import float2
from iprt.geometry.material import material_table
from iprt.settings.features import Features
from iprt.world.real.changed_surfaces import MOST_CONES
from iprt.world.real.highlight_gain import HighlightGain
from iprt.world.real.highlight_sites import SiteLayout
from iprt.world.real.panorama import Panorama

CELL = constant("lib/world/real/gloss.h", "CELL")
"""Side in texels of the cells in which highlights are compared with the panorama."""
CELL_RAYS = 8
"""Rays per cell that measure its irradiance."""
LEVELS = 4
"""Levels of the filter."""


@dataclass(kw_only=True)
class GlossArgs(Block):
    """Glossy real surfaces for rays (`cl/lib/world/real/gloss.h`).

    Attributes
    ----------
    map : (H, W) uint8
        0: diffuse, else 1 + index of the material.
    materials, reflectance, gain
        `Highlight.table`, `reflectance` and `gain`.
    columns, rows : int
        Cells of `gain`.
    size : float2
        Columns and rows: see `GridArgs`.
    """

    map: Bytes
    materials: Float4s
    reflectance: Float4s
    gain: Float4s
    columns: Int32
    rows: Int32
    size: Float2 = None

    def __post_init__(self) -> None:
        self.size = float2(self.columns, self.rows)


class Highlight:
    """Split of the panorama into diffuse radiance and specular radiance towards the camera.

    Attributes
    ----------
    table : (rows, 4) float32
        `material_table()` of the real materials.
    reflectance : (materials, 4) float32
        Reflectance of the conductors among them.
    gain : (rows, columns, 4) float32
        `HighlightGain.gain`.
    """

    def __init__(
        self,
        device: ComputeDevice,
        panorama: Panorama,
        features: Features,
    ) -> None:
        """Create the kernels; `panorama` was built with gloss."""
        materials = features.real_materials
        self._device = device
        self._panorama = panorama
        self._settings = features.settings
        defines = features.real_defines()
        layout = SiteLayout.of(materials, panorama.width, panorama.height)
        blocks, rays = max(layout.blocks, 1), self._settings.gloss.rays

        def kernel(name: str, items: int = 0) -> Kernel:
            return device.kernel("world/real/highlight.cl", name, defines, items=items)

        trace, table = self._settings.trace, material_table(materials)
        self._of_paths = (
            *(table, layout.table, rays, self._settings.seed, defines),
            *(trace.thickness, trace.thickness_ratio, trace.back_faces),
            panorama.outside is not None,
        )
        self._traced = False
        self._layout = layout
        self._trace = kernel("trace_sites", blocks)
        self._trace_cells = kernel("trace_cells")
        self._gather = kernel("gather_sites", blocks)
        self._filter = kernel("filter_sites", blocks)
        self._measure = kernel("measure_cells")
        self._remove = kernel("remove_highlight")
        self._sites = device.empty("highlight sites", (blocks,), np.int32)
        self._blocks = device.empty("highlight blocks", (blocks,), np.int32)
        self._table = device.upload("highlight layout", np.atleast_2d(layout.table))
        self._paths = device.empty("highlight paths", (blocks, rays, 4))
        self._samples = [device.empty(f"highlight samples {i}", (blocks, 4)) for i in range(2)]
        self._cones = device.empty("highlight cones", (MOST_CONES, 4))
        self._gloss: NDArray[np.uint8] | None = None
        self._placed, self._count = np.zeros(blocks, bool), 0
        cells = (-(-panorama.height // CELL), -(-panorama.width // CELL), 4)
        self._cell_paths = device.empty("highlight cell paths", (*cells[:2], CELL_RAYS, 4))
        self._cells = [
            device.empty(f"highlight {name}", cells) for name in ("seen", "specular", "irradiance")
        ]
        self.table = device.upload("real materials", table)
        self._limit = HighlightGain(device, cells[0], cells[1], self.table, len(materials))
        self.gain = self._limit.gain
        reflectance = [(*material.albedo, 0.0) for material in materials]
        self.reflectance = device.upload(
            "real materials' reflectance", np.array(reflectance, np.float32)
        )

    def run(self) -> None:
        """Fill the panorama's `radiated` for its current video frame."""
        panorama = self._panorama
        self._place(panorama.marks)
        cones = panorama.changed.taken()
        if panorama.marks.any():
            self._split(cones)
        rows, columns, _ = self.gain.shape
        self._remove(
            (panorama.width, panorama.height),
            width=panorama.width,
            height=panorama.height,
            gloss=panorama.gloss,
            real_materials=self.table,
            color=panorama.radiance,
            columns=columns,
            rows=rows,
            gain=self.gain,
            min_base=self._limit.min_base,
            radiated=panorama.radiated,
        )

    def _place(self, gloss: NDArray[np.uint8]) -> None:
        """Choose the sites, if the glossy texels are others than the last frame's."""
        if self._gloss is gloss:
            return
        texels = self._layout.sites(gloss)
        self._placed = texels >= 0
        sites = np.flatnonzero(self._placed).astype(np.int32)
        if len(sites):
            self._device.write(self._sites[: len(sites)], sites)
            self._device.write(self._blocks, texels)
        rows = np.logical_or.reduceat(gloss.any(axis=1), np.arange(0, len(gloss), CELL))
        self._limit.place(rows)
        self._gloss, self._count = gloss, len(sites)

    def _split(self, cones: NDArray[np.float32] | None) -> None:
        """Compute highlights and `gain`; surfaces have changed within the cones, None: anywhere."""
        panorama, settings, count = self._panorama, self._settings, self._count
        rows, columns, _ = self.gain.shape
        real = {
            "real": panorama.arguments(settings.trace),
            "gloss": panorama.gloss,
            "real_materials": self.table,
            "sites": self._sites,
            "count": count,
            "blocks": self._blocks,
            "layout": self._table,
            "most_rays": settings.gloss.rays,
            "frame_seed": settings.seed,
            "columns": columns,
            "rows": rows,
        }
        first, self._traced = not self._traced, True
        background = panorama.background
        alone = background is None or background.first
        if first and alone and panorama.marks.size >= WORTH_KEEPING:
            self._trace_first(real)
        elif cones is None or len(cones):
            self._trace_rays(real, cones)
        samples, filtered = self._samples
        if count:
            self._gather((count,), real, paths=self._paths, samples=samples)
        for level in range(LEVELS if count else 0):
            step = 1 << level
            self._filter((count,), real, step=step, samples=samples, filtered=filtered)
            samples, filtered = filtered, samples
        self._calibrate(real, samples)

    def _trace_rays(self, real: Mapping[str, Any], cones: NDArray[np.float32] | None) -> None:
        """Fill the paths of sites and cells that cross the cones; None: all."""
        changes = {"cones": self._cones, "cone_count": -1 if cones is None else len(cones)}
        if cones is not None:
            self._device.write(self._cones[: len(cones)], cones)
        if self._count:
            self._trace((self._count,), real, changes, paths=self._paths)
        rows, columns, _ = self.gain.shape
        paths = self._cell_paths
        self._trace_cells((columns, rows), real, changes, rays=CELL_RAYS, paths=paths)

    def _trace_first(self, real: Mapping[str, Any]) -> None:
        """Fill all paths, which are kept from process to process."""
        device, panorama = self._device, self._panorama
        marks = panorama.marks
        buffers = {"sites": self._paths, "cells": self._cell_paths}
        glossy = np.logical_or.reduceat(marks > 0, np.arange(0, panorama.height, CELL), axis=0)
        glossy = np.logical_or.reduceat(glossy, np.arange(0, panorama.width, CELL), axis=1)
        used = {"sites": self._placed, "cells": glossy}

        def make() -> Arrays:
            self._trace_rays(real, None)
            return {name: device.read(paths)[used[name]] for name, paths in buffers.items()}

        inputs = [device.key, panorama.surfaces.given, marks, *self._of_paths]
        for name, found in kept("paths", __name__, inputs, make).items():
            paths = np.zeros(buffers[name].shape, np.float32)
            paths[used[name]] = found
            device.write(buffers[name], paths)

    def arguments(self) -> GlossArgs:
        """Return the glossy surfaces for rays."""
        rows, columns, _ = self.gain.shape
        return GlossArgs(
            map=self._panorama.gloss,
            materials=self.table,
            reflectance=self.reflectance,
            gain=self.gain,
            columns=columns,
            rows=rows,
        )

    def _calibrate(self, real: Mapping[str, Any], samples: cla.Array) -> None:
        """Fill `gain`, and `radiated` of glossy texels with their highlight, from `samples`."""
        rows, columns, _ = self.gain.shape
        seen, specular, irradiance = self._cells
        self._measure(
            (columns, rows),
            real,
            rays=CELL_RAYS,
            samples=samples,
            paths=self._cell_paths,
            radiated=self._panorama.radiated,
            seen=seen,
            specular=specular,
            irradiance=irradiance,
        )
        self._limit.run(seen, specular, irradiance)
