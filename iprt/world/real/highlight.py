"""Separation of highlights on glossy real surfaces from the captured radiance, per video frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from iprt.device.block import Block, Float4s, Int32, Ints
from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.device.kernel_source import constant
from iprt.geometry.material import material_table
from iprt.settings.features import Features
from iprt.world.real.highlight_gain import highlight_gain
from iprt.world.real.panorama import Panorama

CELL = constant("lib/world/real/gloss.h", "CELL")
"""Side in texels of the cells in which highlights are compared with the panorama."""
CELL_RAYS = 32
"""Rays per cell that measure its irradiance."""
LEVELS = 4
"""Levels of the filter; even, so that the result ends up in the first buffer."""


@dataclass(kw_only=True)
class GlossArgs(Block):
    """Glossy real surfaces for rays (`cl/lib/world/real/gloss.h`).

    Attributes
    ----------
    map : (H, W) int32
        0: diffuse, else 1 + index of the material.
    materials, reflectance, gain
        `Highlight.table`, `reflectance` and `gain`.
    columns, rows : int
        Cells of `gain`.
    """

    map: Ints
    materials: Float4s
    reflectance: Float4s
    gain: Float4s
    columns: Int32
    rows: Int32


class Highlight:
    """Split of the panorama into diffuse radiance and specular radiance towards the camera.

    Attributes
    ----------
    table : (rows, 4) float32
        `material_table()` of the real materials.
    reflectance : (materials, 4) float32
        Reflectance of the conductors among them.
    gain : (rows, columns, 4) float32
        Per cell of the panorama, see `highlight_gain`.
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
        texels = panorama.width * panorama.height

        def kernel(name: str, items: int = 0) -> Kernel:
            return device.kernel("world/real/highlight.cl", name, defines, items=items)

        self._sample = kernel("sample_highlight", texels)
        self._filter = kernel("filter_highlight", texels)
        self._measure = kernel("measure_cells")
        self._remove = kernel("remove_highlight")
        self._list = device.empty("glossy texels", (texels,), np.int32)
        self._variances = [device.empty(f"highlight variance {i}", (texels,)) for i in range(2)]
        cells = (-(-panorama.height // CELL), -(-panorama.width // CELL), 4)
        self.gain = device.empty("highlight gain", cells)
        self._min_base = device.empty("highlight floor", cells)
        self._cells = [
            device.empty(f"highlight {name}", cells) for name in ("seen", "specular", "irradiance")
        ]
        self.table = device.upload("real materials", material_table(materials))
        # A conductor only reflects: it has no diffuse part to compare with.
        self._coated = np.array([False, *(material.kind == "plastic" for material in materials)])
        reflectance = [(*material.albedo, 0.0) for material in materials]
        self.reflectance = device.upload(
            "real materials' reflectance", np.array(reflectance, np.float32)
        )

    def run(self) -> None:
        """Fill the panorama's `highlight` and `radiated` for its current video frame."""
        device, panorama = self._device, self._panorama
        settings, gloss = self._settings, panorama.gloss
        highlight, radiated = panorama.highlight, panorama.radiated
        assert gloss is not None
        glossy = np.flatnonzero(device.read(gloss)).astype(np.int32)
        count = len(glossy)
        if count:
            device.write(self._list[:count], glossy)
            trace = settings.trace
            real = {
                "real": panorama.arguments(trace),
                "list": self._list,
                "count": count,
                "gloss": gloss,
                "real_materials": self.table,
                "real_reflectance": self.reflectance,
            }
            self._sample(
                (count,),
                real,
                most_rays=settings.gloss.rays,
                frame_seed=settings.seed,
                highlight=highlight,
                variance=self._variances[0],
            )
            signal, filtered = zip((highlight, radiated), self._variances, strict=True)
            for level in range(LEVELS):
                self._filter(
                    (count,),
                    real,
                    step=1 << level,
                    highlight=signal[0],
                    variance=signal[1],
                    filtered=filtered[0],
                    filtered_variance=filtered[1],
                )
                signal, filtered = filtered, signal
            self._calibrate(real)
        rows, columns, _ = self.gain.shape
        self._remove(
            (panorama.width, panorama.height),
            width=panorama.width,
            height=panorama.height,
            gloss=gloss,
            real_materials=self.table,
            color=panorama.radiance,
            columns=columns,
            rows=rows,
            gain=self.gain,
            min_base=self._min_base,
            highlight=highlight,
            radiated=radiated,
        )

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

    def _calibrate(self, real: Mapping[str, Any]) -> None:
        """Fill `gain`; `real` holds the arguments of the real layer."""
        rows, columns, _ = self.gain.shape
        seen_cells, specular_cells, irradiance_cells = self._cells
        self._measure(
            (columns, rows),
            real,
            rays=CELL_RAYS,
            frame_seed=self._settings.seed,
            columns=columns,
            rows=rows,
            highlight=self._panorama.highlight,
            seen=seen_cells,
            specular=specular_cells,
            irradiance=irradiance_cells,
        )
        seen, specular, irradiance = (
            self._device.read(cells).astype(np.float64) for cells in self._cells
        )
        gloss = seen[..., 3].astype(np.int64)
        gain, min_base = highlight_gain(
            seen[..., :3],
            specular[..., :3],
            irradiance[..., :3],
            np.where(self._coated[gloss], gloss, 0),
        )
        self._device.write(self.gain, gain)
        self._device.write(self._min_base, min_base)
