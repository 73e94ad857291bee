"""Placement of stored pictures on the sphere: crops, stereo, and shapes other than 2:1."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.safe_reading import require_picture_size
from iprt.files.xmp import gpano_crop

Picture = NDArray[np.float32]
Scalar = TypeVar("Scalar", bound=np.generic)
Eye = Literal["left", "right"]
Fit = Literal["stretch", "pad", "crop"]

BAND = 64
"""Number of rows interpolated at a time."""
DARK = 0.01
"""Largest radiance in the rows of a black bar."""
NEARLY = 0.05
"""Largest deviation from 2:1 of a shape that is likely a rounded or squeezed whole sphere."""
_EXACT = 1e-3
"""Largest distance, in texels, between stored and wanted sample positions that coincide."""


@dataclass(frozen=True)
class Placement:
    """Placement of a video's stored pictures in its panoramas.

    Attributes
    ----------
    stored, size : (int, int)
        Width and height of pictures and panoramas.
    left, top, right, bottom : float
        Edges of the stored picture as parts of the panorama's width and height. Parts below 0 or
        beyond 1 are not shown: bars, or the other eye.
    """

    stored: tuple[int, int]
    size: tuple[int, int]
    left: float
    top: float
    right: float
    bottom: float

    @property
    def known(self) -> float:
        """Share of the sphere that the picture covers."""
        across = min(self.right, 1.0) - max(self.left, 0.0)
        upper, lower = (np.cos(np.pi * np.clip(edge, 0.0, 1.0)) for edge in (self.top, self.bottom))
        return float(across * (upper - lower) / 2.0)

    def alike(self, width: int, height: int) -> Placement | None:
        """Return the placement of depth or normals of a size; None if they are whole panoramas.

        Pictures with the shape of stored color, and no more pixels, are placed like it. A 2:1
        picture is a crop only if stored color is 2:1, too.
        """
        own = self.stored
        is_alike = abs(width * own[1] - height * own[0]) < own[0] and width <= own[0]
        is_whole = width == 2 * height and own[0] != 2 * own[1]
        if (width, height) == self.size or is_whole or not is_alike:
            return None
        rows = max(1, round(self.size[1] * width / own[0]))
        edges = self.left, self.top, self.right, self.bottom
        return Placement((width, height), (2 * rows, rows), *edges)

    def color(self, picture: Picture) -> Picture:
        """Return the interpolated panorama (H, W, 3) of a picture; 0 where it is unknown."""
        rows, columns = self._axes()
        if rows.is_exact and columns.is_exact:
            return self._whole(picture[rows.index][:, columns.index], rows, columns)
        part = np.empty((rows.at.size, columns.at.size, 3), np.float32)
        for first in range(0, rows.at.size, BAND):
            band = slice(first, first + BAND)
            across = _between(picture, rows.at[band], 0)
            part[band] = _between(across, columns.at, 1)
        return self._whole(part, rows, columns)

    def nearest(self, picture: NDArray[Scalar], unknown: float = 0.0) -> NDArray[Scalar]:
        """Return the panorama (H, W, ...) of the nearest stored values; `unknown` elsewhere."""
        rows, columns = self._axes()
        return self._whole(picture[rows.index][:, columns.index], rows, columns, unknown)

    def _axes(self) -> tuple[_Axis, _Axis]:
        columns, rows = self.stored
        width, height = self.size
        return (
            _Axis.of(self.top, self.bottom, rows, height),
            _Axis.of(self.left, self.right, columns, width),
        )

    def _whole(
        self, part: NDArray[Scalar], rows: _Axis, columns: _Axis, unknown: float = 0.0
    ) -> NDArray[Scalar]:
        width, height = self.size
        if part.shape[:2] == (height, width):
            return np.ascontiguousarray(part)
        whole = np.full((height, width, *part.shape[2:]), unknown, part.dtype)
        whole[rows.covered, columns.covered] = part
        return whole


@dataclass(frozen=True)
class _Axis:
    """Stored samples along an axis of the panorama.

    Attributes
    ----------
    covered : slice
        Texels of the panorama that the picture covers.
    at : (N,) float64
        Positions of these texels in units of stored samples, whose centres are integers.
    index : slice or (N,) int
        Nearest stored samples.
    is_exact : bool
        Whether all positions coincide with stored samples.
    """

    covered: slice
    at: NDArray[np.float64]
    index: slice | NDArray[np.intp]
    is_exact: bool

    @classmethod
    def of(cls, low: float, high: float, stored: int, wanted: int) -> _Axis:
        """Build the axis from the stored picture's edges, as parts of the panorama's axis."""
        step = stored / (high - low)
        at = ((np.arange(wanted) + 0.5) / wanted - low) * step - 0.5
        covered = np.flatnonzero((at > -0.5 - _EXACT) & (at < stored - 0.5 + _EXACT))
        # Samples beyond the edge of the sphere, in a bar or the other eye, must not be blended in.
        first = max(0, int(np.ceil(-low * step - _EXACT)))
        last = min(stored, int(np.floor((1.0 - low) * step + _EXACT))) - 1
        at = np.clip(at[covered], first, max(first, last))
        nearest = np.floor(at + 0.5).astype(np.intp)
        is_exact = bool((np.abs(at - nearest) < _EXACT).all())
        in_order = nearest.size > 0 and bool((np.diff(nearest) == 1).all())
        index = slice(int(nearest[0]), int(nearest[-1]) + 1) if in_order else nearest
        ends = (int(covered[0]), int(covered[-1]) + 1) if covered.size else (0, 0)
        return cls(slice(*ends), at, index, is_exact)


def _between(picture: Picture, at: NDArray[np.float64], axis: int) -> Picture:
    """Interpolate linearly along an axis at positions (N,), within the samples."""
    first = np.minimum(at.astype(np.intp), picture.shape[axis] - 1)
    second = np.minimum(first + 1, picture.shape[axis] - 1)
    shape = (-1, 1, 1) if axis == 0 else (1, -1, 1)
    part = (at - first).astype(np.float32).reshape(shape)
    mixed = picture.take(first, axis) * (1 - part) + picture.take(second, axis) * part
    return np.asarray(mixed, np.float32)


def placement_of(
    path: Path, size: tuple[int, int], eye: Eye | None, fit: Fit | None, xmp: str
) -> Placement | None:
    """Return the placement of pictures on the sphere; None if they fill it by default.

    Parameters
    ----------
    path : Path
        Name of the file in errors.
    size : (int, int)
        Width and height as stored.
    eye : "left", "right" or None
        Half of a stereo picture to take; its shape tells above and below from side by side.
    fit : "stretch", "pad", "crop" or None
        How a picture of another shape than 2:1 covers the sphere; see `_fitted`.
    xmp : str
        XMP of the file; `eye` and `fit` override its GPano.

    Raises
    ------
    FormatError
        If the picture has no two eyes, or the panorama would be too large; see also `gpano_crop`.
    """
    is_chosen = eye is not None or fit is not None
    crop = None if is_chosen else gpano_crop(path, xmp, *size)
    if not is_chosen and crop is None:
        return None
    own, across, down = size, 1, 1
    if eye is not None:
        across, down = _halves(path, size)
        own = size[0] // across, size[1] // down
    if crop is not None:
        rows = max(1, round(crop.full[0] / 2.0))
        placed = Placement(size, (2 * rows, rows), crop.left, crop.top, crop.right, crop.bottom)
    elif fit is not None:
        placed = _fitted(own, fit)
    else:
        placed = Placement(own, own, 0.0, 0.0, 1.0, 1.0)
    require_picture_size(path, *placed.size)
    if eye is None:
        return placed
    width, height = placed.right - placed.left, placed.bottom - placed.top
    before = int(eye == "right")
    left = placed.left - width * before * (across - 1)
    top = placed.top - height * before * (down - 1)
    return Placement(size, placed.size, left, top, left + width * across, top + height * down)


def _halves(path: Path, size: tuple[int, int]) -> tuple[int, int]:
    """Return the number of eyes of a stereo picture across and down: 2, 1 or 1, 2."""
    width, height = size
    if 2 * width < 3 * height and height % 2 == 0:
        return 1, 2
    if width > 3 * height and width % 2 == 0:
        return 2, 1
    raise FormatError(
        f"{path}: {width} x {height} pixels are no two panoramas for two eyes: one above the other "
        "they are as wide as high, side by side four times as wide; leave out --eye (eye in "
        "[video])"
    )


def _fitted(size: tuple[int, int], fit: Fit) -> Placement:
    """Place a picture of any shape on the sphere.

    - stretch: it covers the whole sphere, and is resampled;
    - pad: rows at top and bottom, or columns at the sides, are missing and unknown;
    - crop: rows at top and bottom, or columns at the sides, do not belong to the sphere.
    """
    width, height = size
    if fit == "stretch":
        rows = max(1, round(width / 2.0))
        return Placement(size, (2 * rows, rows), 0.0, 0.0, 1.0, 1.0)
    half = -(-width // 2) if fit == "pad" else width // 2
    rows = max(1, max(half, height) if fit == "pad" else min(half, height))
    left, top = (2 * rows - width) // 2, (rows - height) // 2
    right, bottom = left + width, top + height
    return Placement(
        size,
        (2 * rows, rows),
        left / (2 * rows),
        top / rows,
        right / (2 * rows),
        bottom / rows,
    )


def shape_problem(color: Picture) -> str:
    """Return the reason why a picture (H, W, 3) is no panorama, and the likely remedy."""
    height, width = color.shape[:2]
    problem = f"{width} x {height} pixels; an equirect panorama is twice as wide as high"
    if width in (height, 4 * height):
        halves = "one above the other" if width == height else "side by side"
        return (
            f"{problem}; where it is two for two eyes, {halves}, take one by --eye left (eye in "
            "[video])"
        )
    extra = (height - width // 2) // 2
    if extra > 0 and max(color[:extra].max(), color[-extra:].max()) < DARK:
        return f"{problem}; --fit crop (fit in [video]) cuts off the black bars above and below"
    if extra < 0 and abs(width / height - 2.0) > 2.0 * NEARLY:
        return (
            f"{problem}; --fit pad (fit in [video]) where the sphere's top and bottom are missing, "
            "--fit stretch where it is all of it"
        )
    return (
        f"{problem}; --fit stretch (fit in [video]) where it is all of the sphere, crop where it "
        "has extra rows, pad where rows are missing"
    )
