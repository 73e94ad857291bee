"""E_R, the irradiance of real surfaces without objects, cached in panorama space."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.block import Block, Float4s, Float32, Int32
from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.device.kernel_source import constant
from iprt.world.real.camera_motion import STILL
from iprt.world.real.cell_light import CellLight
from iprt.world.real.changed_surfaces import span_of

if TYPE_CHECKING:
    from iprt.settings.features import Features
    from iprt.world.real.panorama import Panorama


BLACK = 1e-6
"""E_R that counts as black, relative to the panorama's mean radiance: ratios to it are noise."""

SURFACES = constant("lib/world/real/irradiance.h", "CACHE_SURFACES")
"""Surfaces of a cell."""

FOREVER = 1e6
"""More samples than a cell ever has."""

MOVED_SAMPLES = 64.0
"""Most samples of a cell that is reprojected because the camera moved. Each reprojection mixes it
with its neighbours a little, and light may have changed."""


@dataclass(kw_only=True)
class IrradianceCacheArgs(Block):
    """Irradiance cache (`cl/lib/world/real/irradiance.h`).

    Attributes
    ----------
    plane : (entries, 4) float32
        xyz: g of the tangent plane g·x = 1; w > 0: a surface.
    irradiance : (2 * entries, 4) float32
        rgb / π, and samples; 0: unknown. Then, per entry, xyz of the flux: sum over directions
        times their luminance / π.
    columns, rows : int
    black : float
        Irradiance up to this counts as black.
    """

    plane: Float4s
    irradiance: Float4s
    columns: Int32
    rows: Int32
    black: Float32


class IrradianceCache:
    """Grid of E_R around the capture centre, refined where traced pixels need it.

    It depends on the video only, not on objects, and all views share it.

    Attributes
    ----------
    rows, columns : int
    plane : (2 * rows * columns, 4) float32
        Tangent plane g (g·x = 1) at each cell's centre, 1 + forgotten samples; all 0: open sky or
        a window. Then, per cell, a thin surface that no centre nearby shows; all 0: none.
    point : (2 * rows * columns, 4) float32
        Positions of those surfaces, in metres; 0.
    mean, irradiance : (4 * rows * columns, 4) float32
        E_R / π as sampled, and after smoothing; number of samples. Then, per surface again, the
        sum of all directions times their luminance / π. The irradiance at other normals follows
        from it (`turned` of `cl/lib/world/real/irradiance.h`); 0.
    """

    def __init__(self, device: ComputeDevice, panorama: Panorama, features: Features) -> None:
        self._device = device
        self._features = features
        self.settings = features.settings.irradiance
        self.rows, self.columns = self.settings.rows, 2 * self.settings.rows
        # With objects as layers, an equirect view has only the layers around the capture centre.
        equirect = features.equirect_view and features.traced_layers
        defines = {"VIEW_EQUIRECT": equirect, **features.real_defines()}

        self._entries = entries = SURFACES * self.rows * self.columns

        def kernel(name: str, **hints: Any) -> Kernel:
            return device.kernel("world/real/irradiance.cl", name, defines, **hints)

        self._place = kernel("place_cells")
        self.plane, self.mean, self.irradiance = self._grids("")
        self.point = device.zeros("irradiance point", (entries, 4))
        if features.moving_camera:
            self._move = kernel("move_cells", later=True)
            self._before = self._grids(" before")
            self._camera = device.zeros("irradiance camera motion", (12,))
        self._light = CellLight(device, panorama.width, panorama.height, self.rows)
        self._listed = device.zeros("irradiance listed", (entries,), np.int32)
        self._cells = device.empty("irradiance cells", (entries,), np.int32)
        self._count, self._next_count = (
            device.zeros(f"irradiance count {i}", (1,), np.int32) for i in range(2)
        )
        settings, grid = self.settings, {"columns": self.columns, "rows": self.rows}
        self._list = kernel("list_cells").fixed(
            grid,
            first=2 * settings.rays,
            enough=settings.samples,
            listed=self._listed,
            cells=self._cells,
        )
        self._refine = kernel("refine_cells", items=entries).fixed(
            rays=settings.rays,
            entries=entries,
            seed=features.settings.seed,
            list=self._cells,
            point=self.point,
        )
        self._smooth = kernel("smooth_cells", items=entries).fixed(
            grid, list=self._cells, listed=self._listed, point=self.point
        )
        self._show = kernel("show_cells", later=True)

    def _grids(self, when: str) -> tuple[cla.Array, cla.Array, cla.Array]:
        plane = self._device.zeros("irradiance plane" + when, (self._entries, 4))
        mean, smooth = (
            self._device.zeros(name + when, (2 * self._entries, 4))
            for name in ("irradiance mean", "irradiance")
        )
        return plane, mean, smooth

    def place(
        self,
        panorama: Panorama,
        motion: NDArray[np.float64],
        *,
        changed: float,
        cut: bool,
    ) -> None:
        """Update the cache to the next video frame: reset moved surfaces, and rescale by the light.

        Parameters
        ----------
        panorama : Panorama
            Holds the next frame.
        motion : (3, 4) float64
            `camera_motion` since the previous frame. Where the camera moved, cells are reprojected.
        changed : float
            Share of the panorama's flux that changed, in [0, 1].
        cut : bool
            The frames show different scenes: all cells are reset.
        """
        grid = (self.columns, SURFACES * self.rows)
        still = np.array_equal(motion, STILL)
        seen = {
            "columns": self.columns,
            "rows": self.rows,
            "real_width": panorama.width,
            "real_height": panorama.height,
            "real_surface": panorama.surface,
            "point": self.point,
        }
        if still:
            kept = 1.0 if cut else FOREVER
            rows, columns = self._changed(panorama, everywhere=cut)
            size = columns.stop - columns.start, rows.stop - rows.start
            for first in (rows.start, self.rows + rows.start) if min(size) > 0 else ():
                at = {"first": first, "first_column": columns.start}
                self._place(size, seen, self._named(""), at, kept=kept)
        else:
            known = self._named("_before")
            now_held = (self.plane, self.mean, self.irradiance)
            (self.plane, self.mean, self.irradiance), self._before = self._before, now_held
            self._device.write(self._camera, motion.astype(np.float32).ravel())
            kept = 1.0 if cut else MOVED_SAMPLES
            self._move(grid, seen, known, self._named(""), kept=kept, camera=self._camera)
        self._light.follow(panorama)
        if still and changed > 0.0 and not cut:
            self._light.relight(panorama, changed, **self._named(""))

    def _changed(self, panorama: Panorama, *, everywhere: bool) -> tuple[slice, slice]:
        """Return rows and columns of cells whose surfaces may have changed."""
        rows, columns = span_of(panorama.changed_rows), panorama.changed_columns
        if everywhere:
            rows, columns = slice(0, panorama.height), slice(0, panorama.width)
        if rows.stop == 0:
            return rows, columns

        def cells(texels: slice, count: int, size: int) -> slice:
            # Cells are compared with those beside them, and texels too.
            first = (texels.start - 1) * count // size - 2
            end = -(-(texels.stop + 1) * count // size) + 2
            return slice(max(first, 0), min(end, count))

        down = cells(rows, self.rows, panorama.height)
        across = cells(columns, self.columns, panorama.width)
        if across.start == 0 or across.stop == self.columns:
            across = slice(0, self.columns)
        return down, across

    def forget(self) -> None:
        """Drop all samples, as in a new cache."""
        for grid in (self.mean, self.irradiance):
            self._device.fill_zero(grid)

    def _named(self, suffix: str) -> dict[str, cla.Array]:
        """Return the grids by the names of kernel parameters."""
        grids = {"plane": self.plane, "mean": self.mean, "smooth": self.irradiance}
        return {name + suffix: grid for name, grid in grids.items()}

    def run(
        self,
        world: Block,
        boxes: cla.Array,
        pixels: Mapping[str, Any],
        *,
        min_solid_angle: float,
    ) -> None:
        """Refine the cells around traced pixels.

        Few rays are used where objects have no noticeable influence yet, and none where objects
        span less than `min_solid_angle` sr.

        Parameters
        ----------
        world : WorldArgs
            Built for the panorama's surfaces.
        boxes : (N, 2, 4) float32
            `object_bounds()` on the device.
        pixels : mapping
            Arguments of the pixels: their layout, list, count, guide and `touched`.
        """
        self._count, self._next_count = self._next_count, self._count
        known = {**self._named(""), "count": self._count}
        self._list(
            (pixels["width"] * pixels["height"],),
            pixels,
            boxes=boxes,
            box_count=boxes.shape[0],
            min_solid_angle=min_solid_angle,
            plane=self.plane,
            mean=self.mean,
            cell_count=self._count,
            next_count=self._next_count,
        )
        self._refine((self._entries,), known, world=world)
        self._smooth((self._entries,), known)

    def show(self, panorama: Panorama, pixels: Mapping[str, Any], shown: cla.Array) -> None:
        """Fill 3 planes with E_R / π of `pixels`; 0 where no traced pixel has needed it."""
        size = pixels["width"], pixels["height"]
        self._show(size, pixels, cache=self.arguments(panorama), shown=shown)

    def arguments(self, panorama: Panorama) -> IrradianceCacheArgs:
        """Return the cache for kernels that read it."""
        return IrradianceCacheArgs(
            plane=self.plane,
            irradiance=self.irradiance,
            columns=self.columns,
            rows=self.rows,
            black=BLACK * panorama.mean_radiance,
        )
