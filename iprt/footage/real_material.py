"""Glossy real surfaces (`[[real_materials]]`), and selection of their texels in a panorama."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import Frame
from iprt.footage.normals import column_spread
from iprt.footage.threads import on_all_cores
from iprt.geometry.equirect import texel_azimuths, texel_polar_angles
from iprt.geometry.material import Material

Mask = NDArray[np.bool_]
Triple = tuple[float, float, float]

MAX_REAL_MATERIALS = 255
"""Largest number of materials: `Frame.gloss` stores 1 + their index in a byte, and 0 is diffuse."""
PARALLEL = 0.9
"""Least cosine between the normals of a texel and a plane: up to 26 degrees apart."""
SMOOTH = 0.2
"""Slope against a plane up to which a surface is parallel to it without a fit: 11 degrees."""
_ROWS = 32


@dataclass(frozen=True)
class Plane:
    """A plane in the world, with a tolerance.

    Attributes
    ----------
    point : (x, y, z)
        A point of the plane, in metres.
    normal : (x, y, z)
        Unit normal.
    tolerance : float
        Largest distance, in metres, of points that count as on the plane.
    """

    point: Triple
    normal: Triple
    tolerance: float


@dataclass(frozen=True)
class Evidence:
    """Evidence that a surface reflects.

    Attributes
    ----------
    t : float
        Student's t of the reflection's strength.
    strength : float
        Strength of the reflection relative to a coat with an index of refraction of 1.5.
    error : float
        Standard error of `strength`.
    low, high : float
        Roughness minus and plus one standard deviation.
    """

    t: float
    strength: float
    error: float
    low: float
    high: float

    def line(self) -> str:
        """Return the evidence as text."""
        return (
            f"found: alpha {self.low:.2g} to {self.high:.2g}, strength {self.strength:.2f} "
            f"± {self.error:.2f}, t = {self.t:.0f}"
        )


@dataclass(frozen=True)
class RealMaterial:
    """A glossy real surface: its texels in the panorama, and its reflection.

    All given selections must hold. Openings and open sky never belong to a surface.

    Attributes
    ----------
    name : str
        Name of the surface.
    material : Material
        "plastic" or "conductor". Of plastic, only the coat matters: the base is the camera's
        picture without the coat's reflection.
    mask : (h, w) bool or None
        Equirect picture, turned with the world; texels read the nearest pixel.
    color : (r, g, b) or None
        Linear color of the surface, in any unit, as chromaticities are compared.
    color_tolerance : float
        Largest distance between chromaticities, see `chromaticity`.
    plane : Plane or None
        Plane that the surface lies on and is parallel to (`PARALLEL`).
    evidence : Evidence or None
        Evidence for an undeclared surface (`iprt.footage.found_gloss`).
    """

    name: str
    material: Material
    mask: Mask | None = None
    color: Triple | None = None
    color_tolerance: float = 0.05
    plane: Plane | None = None
    evidence: Evidence | None = None

    def place(self, frame: Frame, rows: slice = slice(None)) -> Mask:
        """Return (rows, W) bool: the texels that may show this surface, whatever their color."""
        inside = np.isfinite(frame.depth[rows]) & ~frame.opening[rows]
        if self.mask is not None:
            inside &= _nearest(self.mask, frame.width, frame.height)[rows]
        if self.plane is not None:
            inside &= _on_plane(frame, self.plane, rows)
        return inside

    def region(self, frame: Frame) -> Mask:
        """Return (H, W) bool: the texels that show this surface."""
        return self.colored(frame, self.place(frame))

    def colored(self, frame: Frame, place: Mask) -> Mask:
        """Return the texels of `place` that have the surface's color."""
        if self.color is None:
            return place
        return place & _alike(frame.radiance, self.color, self.color_tolerance)


@dataclass(frozen=True)
class Doubt:
    """A plane that stays diffuse.

    Attributes
    ----------
    name : str
        As for a found one, such as "wall_2".
    yaw_deg, pitch_deg : int
        Direction of its middle.
    reason : str
        Why its reflection is not believed.
    """

    name: str
    yaw_deg: int
    pitch_deg: int
    reason: str

    def line(self) -> str:
        """Return a sentence for reports."""
        return f"{self.name} (yaw {self.yaw_deg}, pitch {self.pitch_deg}): {self.reason}"


@dataclass(frozen=True)
class GlossSearch:
    """Planes that reflect, and planes that stay diffuse, in the order of their size."""

    found: tuple[RealMaterial, ...] = ()
    doubts: tuple[Doubt, ...] = ()


def chromaticity(color: NDArray[np.floating]) -> NDArray[np.float64]:
    """Divide linear colors (..., 3) by the sum of their channels; NaN for black.

    The result does not depend on the strength of light. Two chromaticities are at most √2 apart;
    a grey and a wood's brown about 0.2.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(color / color.sum(axis=-1, keepdims=True, dtype=np.float64))


def _alike(color: NDArray[np.float32], wanted: Triple, tolerance: float) -> Mask:
    apart = chromaticity(color) - chromaticity(np.asarray(wanted))
    # NaN, for black texels, is not within any tolerance.
    return np.asarray(np.linalg.norm(apart, axis=-1) <= tolerance)


def _on_plane(frame: Frame, plane: Plane, rows: slice) -> Mask:
    """Return (rows, W) bool: the texels near the plane whose surface is parallel to it.

    Normals are fitted only to texels that are not `SMOOTH`.
    """
    first, stop, _ = rows.indices(frame.height)
    on, smooth = np.zeros((2, stop - first, frame.width), bool)

    def measure(start: int) -> None:
        block = slice(start, min(start + _ROWS, stop))
        own = slice(block.start - first, block.stop - first)
        on[own], smooth[own] = _near(frame, plane, block)

    on_all_cores(measure, range(first, stop, _ROWS))
    doubtful = on if frame.normal is not None else on & ~smooth
    texel = np.flatnonzero(doubtful)
    normal = frame.fitted_normal_at(texel + first * frame.width)
    on.ravel()[texel] = np.abs(normal @ np.asarray(plane.normal, np.float32)) >= PARALLEL
    return on


def _near(frame: Frame, plane: Plane, rows: slice) -> tuple[Mask, Mask]:
    """Return texels (rows, W) within tolerance of a plane, and those with a slope below `SMOOTH`.

    Slopes are measured towards four neighbours. Texels beside an opening count as steep.
    """
    beyond = slice(max(rows.start - 1, 0), min(rows.stop + 1, frame.height))
    theta, phi = texel_polar_angles(frame.height)[beyond, None], texel_azimuths(frame.width)
    x, y, z = plane.normal
    across = (x * np.sin(phi) - z * np.cos(phi)).astype(np.float32)
    offset = np.sin(theta).astype(np.float32) * across + (y * np.cos(theta)).astype(np.float32)
    with np.errstate(invalid="ignore"):
        offset *= frame.depth[beyond]
        offset -= np.float32(np.dot(plane.point, plane.normal))
    own = slice(rows.start - beyond.start, rows.stop - beyond.start)
    on = np.abs(offset[own]) <= plane.tolerance
    smooth = np.zeros_like(on)
    if not on.any():
        return on, smooth
    offset[frame.opening[beyond]] = np.nan
    # The rows next to a pole have a neighbour less, and are left to the fit.
    inner = slice(max(own.start, 1), min(own.stop, len(offset) - 1))
    middle, aside = offset[inner], column_spread(frame.width, frame.height)[beyond][inner]
    column = np.arange(frame.width) + np.stack([-aside, aside])[..., None]
    beside = np.take_along_axis(middle[None], column % frame.width, axis=-1)
    neighbors = offset[inner.start - 1 : inner.stop - 1], offset[inner.start + 1 : inner.stop + 1]
    most = np.float32(SMOOTH * np.pi / frame.height) * frame.depth[beyond][inner]
    with np.errstate(invalid="ignore"):
        flat = [np.abs(other - middle) <= most for other in (*neighbors, *beside)]
    smooth[inner.start - own.start : inner.stop - own.start] = np.logical_and.reduce(flat)
    return on, smooth


def _nearest(mask: Mask, width: int, height: int) -> Mask:
    rows = (2 * np.arange(height) + 1) * mask.shape[0] // (2 * height)
    columns = (2 * np.arange(width) + 1) * mask.shape[1] // (2 * width)
    return mask[np.ix_(rows, columns)]
