"""Separation of highlights on glossy real surfaces from the captured radiance, per video frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.device.block import Block, Float4s, Int32, Ints
from iprt.device.compute import ComputeDevice
from iprt.device.kept import WORTH_KEEPING, Arrays, kept
from iprt.device.kernel import Kernel
from iprt.device.kernel_source import constant
from iprt.footage.frame import Frame
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
        self._defines = defines = features.real_defines()
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

    def run(self, alone: Frame | None = None) -> None:
        """Fill the panorama's `highlight` and `radiated` for its current video frame.

        Parameters
        ----------
        alone : Frame or None
            The current frame, if no other one has left a trace in the panorama. What takes long is
            then kept for large panoramas (`iprt.device.kept`).
        """
        device, panorama = self._device, self._panorama
        gloss, highlight, radiated = panorama.gloss, panorama.highlight, panorama.radiated
        assert gloss is not None
        assert highlight is not None
        glossy = np.flatnonzero(device.read(gloss)).astype(np.int32)
        if alone is not None and len(glossy) and gloss.size >= WORTH_KEEPING:
            inputs = self._inputs(alone)
            found = kept("highlights", __name__, inputs, lambda: self._found(glossy), kernels=True)
            spread = np.zeros((gloss.size, 3), np.float32)
            spread[glossy] = found["highlight"]
            device.write(highlight, spread.reshape(highlight.shape))
            device.write(self.gain, found["gain"])
            device.write(self._min_base, found["min_base"])
        elif len(glossy):
            self._find(glossy)
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

    def _inputs(self, frame: Frame) -> list[object]:
        """Return what decides the highlights of a frame that nothing precedes."""
        device, settings = self._device, self._settings
        return [
            frame,
            settings.trace.model_dump_json(),
            settings.gloss.rays,
            settings.seed,
            self._defines,
            device.identity,
        ]

    def _found(self, glossy: NDArray[np.int32]) -> Arrays:
        """Find highlights and return them: the glossy texels', and the buffers of the gain."""
        self._find(glossy)
        read = self._device.read
        highlight = read(self._panorama.highlight).reshape(-1, 3)[glossy]
        return {
            "highlight": highlight,
            "gain": read(self.gain),
            "min_base": read(self._min_base),
        }

    def _find(self, glossy: NDArray[np.int32]) -> None:
        """Fill `Panorama.highlight` at these texels, before the gain, and `gain`."""
        device, panorama, settings = self._device, self._panorama, self._settings
        count = len(glossy)
        device.write(self._list[:count], glossy)
        real = {
            "real": panorama.arguments(settings.trace),
            "list": self._list,
            "count": count,
            "gloss": panorama.gloss,
            "real_materials": self.table,
            "real_reflectance": self.reflectance,
        }
        self._sample(
            (count,),
            real,
            most_rays=settings.gloss.rays,
            frame_seed=settings.seed,
            highlight=panorama.highlight,
            variance=self._variances[0],
        )
        pictures = (panorama.highlight, panorama.radiated)
        signal, filtered = zip(pictures, self._variances, strict=True)
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
