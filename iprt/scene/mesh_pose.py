"""The orientation and size of a mesh in a scene: up axis, rotation and scale.

Files state no unit and no up axis, except for glTF and USD, which are read in metres with +Y up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from iprt.errors import SceneError
from iprt.files.toml_tables import FARTHEST

Array = NDArray[np.float64]

UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
_TO_UP = {
    "x": ("z", 90.0),
    "-x": ("z", -90.0),
    "y": ("x", 0.0),
    "-y": ("x", 180.0),
    "z": ("x", -90.0),
    "-z": ("x", 90.0),
}
"""Axis and degrees of the rotation that takes each axis to +Y."""
UP_AXES = tuple(_TO_UP)
SHARE_OF_DISTANCE = 0.2
"""Longest side over distance, the default size."""
SMALLEST_M = 1e-6
FLAT = 1e-3
"""Height over longest side up to which an object counts as flat, and its height sets no scale."""


@dataclass(frozen=True)
class MeshPose:
    """The orientation and size of a mesh in a scene.

    Attributes
    ----------
    up : {"x", "-x", "y", "-y", "z", "-z"}
        The file's axis that points up.
    turn_deg : float
        Rotation about the vertical afterwards, counter-clockwise from above.
    height_m : float or None
        Height in metres, or longest side of a flat object.
    unit_m : float or None
        Metres of one unit of the file. Without height and unit, the longest side becomes a fifth of
        the distance.

    Raises
    ------
    SceneError
        The axis is unknown, both sizes are given, or numbers are out of range.
    """

    up: str = "y"
    turn_deg: float = 0.0
    height_m: float | None = None
    unit_m: float | None = None

    def __post_init__(self) -> None:
        if self.up not in _TO_UP:
            raise SceneError(f"--up {self.up}: expected one of {', '.join(UP_AXES)}")
        if not abs(self.turn_deg) <= 36000.0:
            raise SceneError(f"--rotate {self.turn_deg:g}: expected degrees")
        for flag, value in (("height", self.height_m), ("unit", self.unit_m)):
            if value is not None and not 0.0 < value < float("inf"):
                raise SceneError(f"--{flag} {value:g}: expected metres above 0")
        if self.height_m is not None and self.unit_m is not None:
            raise SceneError("--height and --unit both say how large the object is; give one")

    @property
    def rotation(self) -> Array:
        """(3, 3) rotation from the file's axes to upright ones."""
        upright = Rotation.from_euler(*_TO_UP[self.up], degrees=True)
        turned = Rotation.from_euler("y", self.turn_deg, degrees=True) * upright
        # Rounded, so that quarter turns have exact zeros in scene.toml.
        return np.asarray(np.round(turned.as_matrix(), 12) + 0.0)

    def scale(self, extent: Array, distance: float) -> float:
        """Return the metres of one unit of the file.

        Parameters
        ----------
        extent : (3,) float64
            Size of the mesh along upright axes, in its own units.
        distance : float
            Distance of its place in metres.

        Raises
        ------
        SceneError
            The object would be too large or too small.
        """
        longest = float(extent.max())
        if self.unit_m is not None:
            scale = self.unit_m
        elif self.height_m is not None:
            scale = self.height_m / float(extent[1] if extent[1] > FLAT * longest else longest)
        else:
            scale = SHARE_OF_DISTANCE * distance / longest
        if not SMALLEST_M <= scale * longest <= FARTHEST:
            raise SceneError(
                f"the object would be {scale * longest:g} m large; objects are from {SMALLEST_M:g} "
                f"to {FARTHEST:g} m"
            )
        return scale


def parse_unit(text: str) -> float:
    """Return the metres of `m`, `cm`, `mm`, `in`, `ft`, or of a number.

    Raises
    ------
    SceneError
        The text is neither.
    """
    try:
        return UNITS_M[text] if text in UNITS_M else float(text)
    except ValueError:
        raise SceneError(
            f"--unit {text}: expected {', '.join(UNITS_M)}, or the metres of one unit of the file"
        ) from None


def hints(suffix: str, corners: tuple[Array, Array], pose: MeshPose) -> list[str]:
    """Return the flags that a mesh may need, judged by its size and position in its file.

    Parameters
    ----------
    suffix : str
        Suffix of the file's name, in lower case.
    corners : pair of (3,) float64
        Lowest and highest corner, in the file's axes and units.
    pose : MeshPose
        The chosen pose.
    """
    low, high = corners
    extent = high - low
    found = []
    longest = float(extent.max())
    if pose.unit_m is None and pose.height_m is None and longest >= 10.0:
        sizes = " or ".join(
            f"--unit {unit} ({longest * UNITS_M[unit]:.3g} m)" for unit in ("cm", "mm")
        )
        found.append(f"its longest side is {longest:.6g} units of its file; is it {sizes}?")
    if pose.up == "y" and suffix in (".ply", ".obj", ".stl"):
        # Most models stand on 0, centred around their up axis.
        stands = np.abs(low) <= 0.02 * extent
        if suffix == ".stl" or (stands[2] and not stands[1]):
            found.append("+Y of its file is up; if that should be +Z, give --up z")
    return found
