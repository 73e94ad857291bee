"""Voxels of the real world and of the objects in mip chains, and the prefiltered panorama."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pyopencl import cltypes

from iprt.device.block import Block, Float4, Float4s, Floats, Int4s, Int32, when
from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.world.real.panorama import Panorama

Float = NDArray[np.float64]

BLOCK = 8
"""Sides of a grid are multiples of this number of voxels: the first levels halve evenly."""
MARGIN = 2
"""Least number of empty voxels around the contents of a grid."""
LONGEST = 2
"""Largest number of voxels along a side of a grid, relative to a cube of the same resolution."""
MOST_LEVELS = 16
ROOM_SHARE, ROOM_DEPTHS = 0.98, 3.0
"""Box of the room: it holds this share of the panorama's texels along each axis, and reaches at
most this multiple of the median depth from the capture centre."""
ROOM_ROWS = 128
"""Rows of depth texels for the box: at least this number, and less than twice as many."""
PREFILTERED_ROWS, COARSEST_ROWS = 256, 2
"""Rows of the finest and of the coarsest level of a prefiltered panorama."""


@dataclass(kw_only=True)
class VoxelsArgs(Block):
    """Mip chain of voxels (`cl/lib/trace/voxels.h`).

    Attributes
    ----------
    opacity, light : (V, 4) float32
        Of `Voxels`.
    levels : (count, 4) int32
        Voxels along x, y, z; first voxel.
    count : int
    box : float4
        Lower corner, and side of a voxel of the finest level, metres.
    """

    opacity: Float4s
    light: Float4s
    levels: Int4s
    count: Int32
    box: Float4


@dataclass(kw_only=True)
class PrefilteredArgs(Block):
    """Mip chain of a panorama's radiance (`cl/lib/trace/prefiltered.h`).

    Attributes
    ----------
    texels : (T, 3) float32
    levels : (count, 4) int32
        Width, height, first texel.
    count : int
    """

    texels: Floats
    levels: Int4s
    count: Int32


@dataclass(kw_only=True)
class SurroundingsArgs(Block):
    """Environment around the voxels of the room, behind its windows, and its change by objects."""

    panorama: PrefilteredArgs
    outside: PrefilteredArgs | None = when("OPENING_ENVIRONMENT")
    delta: VoxelsArgs | None = when("DELTA")


@dataclass(frozen=True)
class Grid:
    """Grid of cubic voxels along the axes of the capture centre.

    Attributes
    ----------
    low : (3,) float64
        Lower corner, metres.
    voxel : float
        Side of a voxel, metres.
    size : (3,) int
        Voxels along x, y, z.
    """

    low: Float
    voxel: float
    size: tuple[int, int, int]

    @property
    def levels(self) -> NDArray[np.int32]:
        """(L, 4) voxels along x, y, z and first voxel of each level; the last has one voxel."""
        rows, first, size = [], 0, np.array(self.size)
        while True:
            rows.append([*size, first])
            if size.max() == 1:
                return np.array(rows, np.int32)
            first += int(size.prod())
            size = -(-size // 2)


def fitted_grid(low: Float, high: Float, resolution: int) -> Grid:
    """Return the finest grid around a box that has at most `resolution` cubed voxels.

    Parameters
    ----------
    low, high : (3,) float64
        Corners of the box, metres.
    """
    extent = np.maximum(high - low, 1e-6)
    voxel = max(
        float(np.cbrt(extent.prod())) / resolution,
        float(extent.max()) / (LONGEST * resolution - 2 * MARGIN - BLOCK),
    )
    while True:
        size = BLOCK * np.ceil((extent / voxel + 2 * MARGIN) / BLOCK).astype(int)
        if size.prod() <= resolution**3:
            break
        voxel *= 1.02
    x, y, z = (int(n) for n in size)
    return Grid(0.5 * (low + high) - 0.5 * voxel * size, voxel, (x, y, z))


def room_box(depth: NDArray[np.float32], median_depth: float) -> tuple[Float, Float]:
    """Return the corners of a box around most real surfaces, metres.

    Parameters
    ----------
    depth : (H, W) float32
        Metres from the capture centre; +inf: open sky.
    """
    step = max(depth.shape[0] // ROOM_ROWS, 1)
    directions = View(depth.shape[1], depth.shape[0], projection="equirect").directions()
    directions, depth = directions[::step, ::step], depth[::step, ::step]
    seen = np.isfinite(depth)
    if not seen.any():
        return -np.ones(3), np.ones(3)
    points = directions[seen].astype(np.float64) * depth[seen][:, None]
    outside = 0.5 * (1.0 - ROOM_SHARE)
    low, high = np.quantile(points, [outside, 1.0 - outside], axis=0)
    most = ROOM_DEPTHS * median_depth
    return np.maximum(low, -most), np.minimum(high, most)


class Voxels:
    """Mip chain of voxels with opacity and radiance.

    Attributes
    ----------
    opacity : (V, 4) float32
        Opacity along x, y, z, in [0, 1], and weight of windows; level after level.
    light : (V, 4) float32
        Radiance times weight, and weight.
    levels : (MOST_LEVELS, 4) int32
        `Grid.levels`.
    grid : Grid
    resolution : int
        The finest level has at most `resolution` cubed voxels.
    """

    def __init__(
        self, device: ComputeDevice, name: str, resolution: int, *, anisotropic: bool, of: str = ""
    ) -> None:
        """Allocate the levels.

        Parameters
        ----------
        name : str
            Voxels of what, in the names of buffers.
        resolution : int
            The finest level has at most `resolution` cubed voxels.
        anisotropic : bool
            Coarse voxels have an opacity along each axis.
        of : str
            Prefix of the buffers' names.
        """
        self._device, self.resolution = device, resolution
        label = f"{of} {name} voxels"
        # A level with odd sides is followed by one with more than an eighth of its voxels.
        voxels = resolution**3 + resolution**3 // 4
        self.opacity = device.zeros(f"{label} opacity", (voxels, 4))
        self.light = device.zeros(f"{label} light", (voxels, 4))
        self.levels = device.zeros(f"{label} levels", (MOST_LEVELS, 4), np.int32)
        self._reduce = device.kernel(
            "trace/reduce_voxels.cl", "reduce_voxels", {"ISOTROPIC": not anisotropic}
        ).fixed(levels=self.levels, opacity=self.opacity, light=self.light)
        self.place(Grid(np.zeros(3), 1.0, (BLOCK, BLOCK, BLOCK)))

    def place(self, grid: Grid) -> None:
        """Take the shape of `grid`; the contents of the voxels become invalid."""
        self.grid = grid
        rows = np.zeros((MOST_LEVELS, 4), np.int32)
        rows[: len(grid.levels)] = grid.levels
        self._device.write(self.levels, rows)
        self.box = cltypes.make_float4(*grid.low, grid.voxel)

    @property
    def finest(self) -> int:
        """Number of voxels in the finest level."""
        return int(np.prod(self.grid.size))

    def reduce(self) -> None:
        """Compute the coarser levels from the finest one."""
        for level, row in enumerate(self.grid.levels[1:], 1):
            self._reduce((int(row[:3].prod()),), level=level)

    def arguments(self) -> VoxelsArgs:
        """Return the voxels for cones."""
        return VoxelsArgs(
            opacity=self.opacity,
            light=self.light,
            levels=self.levels,
            count=len(self.grid.levels),
            box=self.box,
        )


class PrefilteredPanorama:
    """Mip chain of a panorama's radiance.

    Attributes
    ----------
    levels : (L, 4) int
        Width, height, first texel.
    texels : (T, 3) float32
    """

    def __init__(self, device: ComputeDevice, name: str, *, openings: bool = False) -> None:
        """Allocate the levels.

        Parameters
        ----------
        name : str
            Name of the buffer.
        openings : bool
            Hold the radiance behind windows: in directions where the panorama shows neither a
            window nor the sky, the estimate of the outside stands in.
        """
        self._device = device
        rows, first, height = [], 0, PREFILTERED_ROWS
        while height >= COARSEST_ROWS:
            rows.append([2 * height, height, first, 0])
            first += 2 * height * height
            height //= 2
        self.levels = np.array(rows, np.int32)
        self.texels = device.zeros(name, (first, 3))
        self._levels = device.upload(f"{name} levels", self.levels)
        self._openings = openings
        self._reduce = device.kernel("trace/reduce_panorama.cl", "reduce_panorama")

    def load(self, panorama: Panorama) -> None:
        """Prefilter the frame that the panorama holds."""
        surface = panorama.surface if self._openings else None
        source = panorama.width, panorama.height, 0
        for number, (width, height, first, _) in enumerate(self.levels.tolist()):
            self._reduce(
                (width, height),
                real_surface=surface if number == 0 else None,
                real_outside=panorama.outside,
                source_width=source[0],
                source_height=source[1],
                source_first=source[2],
                width=width,
                height=height,
                first=first,
                source=panorama.radiated if number == 0 else self.texels,
                texels=self.texels,
            )
            source = width, height, first

    def level(self, number: int) -> Float:
        """Return the (height, width, 3) texels of a level."""
        width, height, first, _ = self.levels[number].tolist()
        texels = self._device.read(self.texels)[first : first + width * height]
        return np.asarray(texels.reshape(height, width, 3), np.float64)

    def arguments(self) -> PrefilteredArgs:
        """Return the mip chain for cones."""
        return PrefilteredArgs(texels=self.texels, levels=self._levels, count=len(self.levels))
