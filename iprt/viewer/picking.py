"""Picking of pixels and surfaces in a window's picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.viewer.lens import BUFFERS
from iprt.viewer.session import Shown
from iprt.viewer.visible_surfaces import Geometry, Surface


@dataclass(frozen=True, eq=False)
class Readout:
    """Values of a pixel.

    Attributes
    ----------
    x, y : int
        Pixel of the rendered picture.
    radiance : (3,) float32
        Linear radiance.
    buffer : str or None
        The displayed auxiliary picture, if any.
    value : (1..3,) float32 or None
        Value of that picture, in `unit`.
    unit : str
    depth_m : float or None
        Distance of the visible surface from the capture centre; +inf for open sky, None if unknown
        during motion.
    normal : (3,) float64 or None
        World-space normal; None for open sky, or if unknown.
    name : str or None
        Name of the object at the pixel.
    """

    x: int
    y: int
    radiance: NDArray[np.float32]
    buffer: str | None
    value: NDArray[np.float32] | None
    unit: str
    depth_m: float | None
    normal: NDArray[np.float64] | None
    name: str | None

    def rows(self) -> list[tuple[str, str]]:
        """Return labels and formatted values with units."""
        rows = [("pixel", f"{self.x}, {self.y}"), ("linear RGB", _numbers(self.radiance))]
        if self.buffer is not None and self.value is not None:
            value = f"{_numbers(self.value)} {self.unit}".rstrip()
            rows.append((BUFFERS[self.buffer].name.lower(), value))
        if self.depth_m is not None:
            far = f"{self.depth_m:.3f} m" if self.depth_m < np.inf else "open sky"
            rows.append(("distance", far))
        if self.normal is not None:
            rows.append(("normal", ", ".join(f"{value:+.2f}" for value in self.normal)))
        if self.name is not None:
            rows.append(("object", self.name))
        return rows


class Picking:
    """The displayed picture and its surfaces, for picking.

    Positions are fractions of its width and height, from the upper left corner.
    """

    def __init__(self) -> None:
        self._shown: Shown | None = None
        self._at_rest: tuple[Geometry, int] | None = None  # the last geometry, and its video frame

    def follow(self, shown: Shown) -> None:
        """Switch to another picture."""
        self._shown = shown
        if shown.geometry is not None:
            self._at_rest = shown.geometry, shown.frame

    def readout(self, x: float, y: float, buffer: str | None) -> Readout | None:
        """Return the values of the pixel at a position; None without a picture or outside of it.

        Parameters
        ----------
        x, y : float
        buffer : str or None
            The displayed auxiliary picture, if any.
        """
        found = self._pixel(x, y)
        if found is None:
            return None
        shown, column, row = found
        depth, normal, name = None, None, None
        if (surfaces := self._surfaces(x, y)) is not None:
            geometry, *place = surfaces
            surface, name = geometry.seen(*place), geometry.object_at(*place)
            depth = np.inf if surface is None else surface.depth_m
            normal = None if surface is None else surface.normal
        values = None if buffer is None else shown.picture.aovs.get(buffer)
        return Readout(
            column,
            row,
            shown.picture.color[row, column],
            None if values is None else buffer,
            None if values is None else np.atleast_1d(values[row, column]),
            "" if buffer is None else BUFFERS[buffer].unit,
            depth,
            normal,
            name,
        )

    def object_at(self, x: float, y: float) -> str | None:
        """Return the name of the visible object at a position, or None."""
        found = self._surfaces(x, y)
        return None if found is None else found[0].object_at(*found[1:])

    def ground(self, x: float, y: float, radius: float, *, upright: bool = False) -> Surface | None:
        """Return the real surface that supports an object at a position; None if unknown.

        `radius` is the radius of its footprint in metres; see `Geometry.ground`.
        """
        found = self._surfaces(x, y)
        return None if found is None else found[0].ground(*found[1:], radius, upright=upright)

    def _pixel(self, x: float, y: float) -> tuple[Shown, int, int] | None:
        shown = self._shown
        if shown is None or not (0.0 <= x < 1.0 and 0.0 <= y < 1.0):
            return None
        height, width = shown.picture.color.shape[:2]
        return shown, int(x * width), int(y * height)

    def _surfaces(self, x: float, y: float) -> tuple[Geometry, int, int] | None:
        """Return the geometry of the picture, and the pixel at a position.

        Pictures during motion may have none of their own. The last geometry at rest remains valid
        for real surfaces until the view or the video moves.
        """
        found = self._pixel(x, y)
        if found is None or self._at_rest is None:
            return None
        shown, (geometry, frame) = found[0], self._at_rest
        view = geometry.view
        if frame != shown.frame or shown.request.view.resized(view.width, view.height) != view:
            return None
        return geometry, int(x * view.width), int(y * view.height)


def _numbers(values: NDArray[np.float32]) -> str:
    return ", ".join(f"{value:.4g}" for value in values)
