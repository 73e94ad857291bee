"""Conversion of stored depth values to metres."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.footage.video.placement import Placement
from iprt.geometry.equirect import texel_polar_angles

Picture = NDArray[np.float32]

MAX_WHITE = 1.01
"""Upper bound of floats that are meant to go from 0 to 1."""
UNMEASURED = float(np.finfo(np.float32).min)
"""Depth where there is a surface without a measurement, also as a value in files."""


def usable(depth: Picture) -> NDArray[np.bool_]:
    """Return where there is a surface; elsewhere depth is 0, negative, NaN or infinite."""
    with np.errstate(invalid="ignore"):
        return np.asarray((depth > 0.0) & (depth < np.inf))


@dataclass(frozen=True)
class DepthSamples:
    """A depth picture as stored.

    Attributes
    ----------
    values : (H, W) of any type
    black, white : float
        Stored values of black and white.
    bits : int
        Number of bits of integers; 0 for floats.
    exact : bool
        Whether values are lossless.
    """

    values: NDArray[Any]
    black: float
    white: float
    bits: int
    exact: bool

    def placed(self, placement: Placement) -> DepthSamples:
        """Return the samples placed on the sphere, if they need it; see `Placement.alike`."""
        alike = placement.alike(self.values.shape[1], self.values.shape[0])
        if alike is None:
            return self
        # Around a crop, use a value that no `DepthMarks` can name: it is no hole in a surface.
        values = self.values.astype(np.float32, copy=False)
        return replace(self, values=alike.nearest(values, unknown=-np.inf))


@dataclass(frozen=True)
class DepthMarks:
    """Stored values that mark missing depth.

    Attributes
    ----------
    invalid : tuple of float
        Values without a measurement: holes in a surface.
    sky : tuple of float
        Values without a surface.
    """

    invalid: tuple[float, ...] = ()
    sky: tuple[float, ...] = ()

    def masks(self, values: NDArray[Any]) -> list[tuple[NDArray[np.bool_], float]]:
        """Return masks (H, W) of the marks, each with the depth to use instead."""
        kind = np.float32 if values.dtype.kind == "f" else np.float64
        return [
            (np.isnan(values) if np.isnan(mark) else values == kind(mark), shown)
            for marks, shown in ((self.invalid, UNMEASURED), (self.sky, np.inf))
            for mark in marks
        ]


@dataclass(frozen=True)
class DepthCode:
    """Meaning of stored depth values. A value of 0, or black, is never a surface.

    Attributes
    ----------
    scale : float or None
        Metres per stored unit.
    ends : (float, float) or None
        Depth in metres at black and at white.
    encoding : "linear" or "inverse"
        Whether depth or its inverse is linear in the stored value, between `ends`.
    kind : "distance" or "cube"
        Distance along the ray, or its component along the axis of the cube face that the ray hits.
    marks : DepthMarks or None
        Values that mark missing depth; None to detect them in the first frame.
    """

    scale: float | None = None
    ends: tuple[float, float] | None = None
    encoding: Literal["linear", "inverse"] = "linear"
    kind: Literal["distance", "cube"] = "distance"
    marks: DepthMarks | None = None

    @property
    def is_known(self) -> bool:
        """Return whether integers can be converted to metres."""
        return self.scale is not None or self.ends is not None

    def describe(self) -> str:
        """Return a phrase for reports."""
        along = "" if self.kind == "distance" else "; along the axes of a cube's faces"
        if self.ends is None:
            return f"{self.scale or 1.0:g} m per stored unit{along}"
        grows = "depth" if self.encoding == "linear" else "1 / depth"
        return f"{self.ends[0]:g} m at black to {self.ends[1]:g} m at white, even in {grows}{along}"

    def decoded(self, path: Path, samples: DepthSamples, marks: DepthMarks) -> Picture:
        """Return depth (H, W) in metres, with marks replaced.

        Parameters
        ----------
        path : Path
            Name of the file in errors.
        marks : DepthMarks
            Marks of the video: given, or found in its first frame.

        Raises
        ------
        FormatError
            If `ends` are given for floats beyond 1, which are usually metres.
        """
        masks = marks.masks(samples.values)
        self._require_range(path, samples, masks)
        metres = self.metres(samples.values, samples.black, samples.white)
        if masks and metres is samples.values:
            metres = metres.copy()  # the picture may be cached for all frames
        for mask, shown in masks:
            metres[mask] = shown
        return metres

    def _require_range(
        self, path: Path, samples: DepthSamples, masks: list[tuple[NDArray[np.bool_], float]]
    ) -> None:
        if self.ends is None or samples.bits:
            return
        there = np.isfinite(samples.values)
        for mask, _ in masks:
            there &= ~mask
        most = float(np.max(samples.values, initial=0.0, where=there))
        if most > MAX_WHITE:
            raise FormatError(
                f"{path}: stores floats up to {most:.4g}, but a depth range (depth_range) is for "
                "values from 0 to 1; leave it out where depth is stored in metres"
            )

    def metres(self, stored: NDArray[Any], black: float, white: float) -> Picture:
        """Return depth (H, W) in metres; 0, negative, NaN or inf where there is no surface.

        Parameters
        ----------
        stored : (H, W) of any type
        black, white : float
            Stored values of black and white, used with `ends` only.
        """
        value = stored.astype(np.float32, copy=False)
        with np.errstate(all="ignore"):
            if self.ends is None:
                return value if self.scale in (None, 1.0) else value * np.float32(self.scale)
            part = (value - np.float32(black)) * np.float32(1.0 / (white - black))
            low, high = self.ends
            if self.encoding == "inverse":
                low, high = 1.0 / low, 1.0 / high
            mixed = np.float32(low) + part * np.float32(high - low)
            metres = 1.0 / mixed if self.encoding == "inverse" else mixed
            return np.where(part > 0.0, metres, np.float32(0.0))


@lru_cache(maxsize=2)
def cube_factor(height: int, width: int) -> Picture:
    """Return the distance (height, width) along each ray to a cube face at distance 1."""
    phi = (np.arange(width) + 0.5) / width * 2.0 * np.pi
    theta = texel_polar_angles(height)[:, None]
    aside = np.maximum(np.abs(np.sin(phi)), np.abs(np.cos(phi))).astype(np.float32)
    sin, cos = np.sin(theta).astype(np.float32), np.abs(np.cos(theta)).astype(np.float32)
    return np.asarray(np.float32(1.0) / np.maximum(sin * aside, cos))


def unit_problem(name: str) -> str:
    """Return the message that a file needs a `depth_scale` or `depth_range`."""
    return (
        f"video.depth_scale: {name} stores integers; say how many metres one step is "
        "(0.001 for millimetres), or give depth_range, the metres of black and of white"
    )
