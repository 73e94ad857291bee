"""Stored values of depth to metres."""

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
"""Floats that go from 0 to 1 are no larger."""
UNMEASURED = float(np.finfo(np.float32).min)
"""Depth where a surface is said to be that was not measured; where a file holds it, too."""


def usable(depth: Picture) -> NDArray[np.bool_]:
    """Return where there is a surface; elsewhere depth is 0, negative, NaN or infinite."""
    with np.errstate(invalid="ignore"):
        return np.asarray((depth > 0.0) & (depth < np.inf))


@dataclass(frozen=True)
class DepthSamples:
    """A picture of depth as stored.

    Attributes
    ----------
    values : (H, W) of any type
    black, white : float
        Stored values of both.
    bits : int
        Bits of its integers; 0 for floats.
    exact : bool
        Whether values are kept as they were written: no lossy codec.
    """

    values: NDArray[Any]
    black: float
    white: float
    bits: int
    exact: bool

    def placed(self, placement: Placement) -> DepthSamples:
        """Return these as they lie in the sphere, if they do as colour; see `Placement.alike`."""
        alike = placement.alike(self.values.shape[1], self.values.shape[0])
        if alike is None:
            return self
        # Of no value that `DepthMarks` may name: around a crop is no hole in a surface.
        values = self.values.astype(np.float32, copy=False)
        return replace(self, values=alike.nearest(values, unknown=-np.inf))


@dataclass(frozen=True)
class DepthMarks:
    """Stored values that are no depth.

    Attributes
    ----------
    invalid : tuple of float
        Nothing was measured there: a hole in a surface.
    sky : tuple of float
        There is no surface.
    """

    invalid: tuple[float, ...] = ()
    sky: tuple[float, ...] = ()

    def masks(self, values: NDArray[Any]) -> list[tuple[NDArray[np.bool_], float]]:
        """Return where values (H, W) are marks, and the values read there in place of metres."""
        marks = [(mark, UNMEASURED) for mark in self.invalid] + [
            (mark, np.inf) for mark in self.sky
        ]
        kind = np.float32 if values.dtype.kind == "f" else np.float64
        return [
            (np.isnan(values) if np.isnan(mark) else values == kind(mark), shown)
            for mark, shown in marks
        ]


@dataclass(frozen=True)
class DepthCode:
    """The meaning of stored values. A value of 0, or black, is no surface in any case.

    Attributes
    ----------
    scale : float or None
        Metres per stored unit.
    ends : (float, float) or None
        Metres that black and white stand for.
    encoding : "linear" or "inverse"
        Between `ends`, whether depth or its inverse grows in proportion with the stored value.
    kind : "distance" or "cube"
        What is measured: the distance along the ray, or the part of it along the axis of that face
        of a cube which the ray passes, from its centre.
    marks : DepthMarks or None
        Values that are no depth; None where they are looked for in the first frame.
    """

    scale: float | None = None
    ends: tuple[float, float] | None = None
    encoding: Literal["linear", "inverse"] = "linear"
    kind: Literal["distance", "cube"] = "distance"
    marks: DepthMarks | None = None

    @property
    def is_known(self) -> bool:
        """Whether integers can be converted to metres."""
        return self.scale is not None or self.ends is not None

    def describe(self) -> str:
        """As text."""
        along = "" if self.kind == "distance" else "; along the axes of a cube's faces"
        if self.ends is None:
            return f"{self.scale or 1.0:g} m per stored unit{along}"
        grows = "depth" if self.encoding == "linear" else "1 / depth"
        return f"{self.ends[0]:g} m at black to {self.ends[1]:g} m at white, even in {grows}{along}"

    def decoded(self, path: Path, samples: DepthSamples, marks: DepthMarks) -> Picture:
        """Return measured depth (H, W) in metres, without values marked as no depth.

        Parameters
        ----------
        path : Path
            Names the file in errors.
        marks : DepthMarks
            Marks of the video: given, or found in its first frame.

        Raises
        ------
        FormatError
            `ends` are given for floats that go beyond 1: metres, mostly.
        """
        masks = marks.masks(samples.values)
        self._require_range(path, samples, masks)
        metres = self.metres(samples.values, samples.black, samples.white)
        if masks and metres is samples.values:
            metres = metres.copy()  # a picture may be kept for all frames
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
        """Return measured depth (H, W) in metres; 0, negative, NaN or inf without a surface.

        Parameters
        ----------
        stored : (H, W) of any type
        black, white : float
            Stored values of both, which only `ends` looks at.
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
    """Return the distance (height, width) along each ray where a cube's face measures 1."""
    phi = (np.arange(width) + 0.5) / width * 2.0 * np.pi
    theta = texel_polar_angles(height)[:, None]
    aside = np.maximum(np.abs(np.sin(phi)), np.abs(np.cos(phi))).astype(np.float32)
    sin, cos = np.sin(theta).astype(np.float32), np.abs(np.cos(theta)).astype(np.float32)
    return np.asarray(np.float32(1.0) / np.maximum(sin * aside, cos))


def unit_problem(name: str) -> str:
    """The message that a file needs a `depth_scale` or `depth_range`."""
    return (
        f"video.depth_scale: {name} stores integers; say how many metres one step is "
        "(0.001 for millimetres), or give depth_range, the metres of black and of white"
    )
