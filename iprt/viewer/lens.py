"""Display of a picture: exposure, tone curve, false colors of buffers, comparisons."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import matplotlib
import numpy as np
from numpy.typing import NDArray

from iprt.output.display import Bytes, Curve, developed
from iprt.viewer.labels import Label

Appearance = Literal[
    "radiance", "change", "share", "ratio", "direction", "distance", "motion", "label", "count"
]


@dataclass(frozen=True)
class Buffer(Label):
    """An auxiliary picture as it is shown.

    Attributes
    ----------
    appearance : str
        Kind of its false colors.
    unit : str
        Unit of its values; empty if there is none.
    """

    appearance: Appearance
    unit: str = ""

    @property
    def scaled(self) -> bool:
        """True if its colors follow the range of its values."""
        return self.appearance in _SCALED


ERROR_LEVELS = 64
"""Difference, out of 255, shown as white in an error map."""
MOTION_PX = 16.0
"""Motion in pixels with full color."""


BUFFERS: Mapping[str, Buffer] = {
    "background": Buffer("Background", "The video without objects.", "radiance"),
    "normal": Buffer(
        "Normal", "World-space normals of surfaces: x, y, z as red, green, blue.", "direction"
    ),
    "depth": Buffer(
        "Depth", "Distance from the camera in metres. Near is bright.", "distance", "m"
    ),
    "albedo": Buffer("Albedo", "Base color of the objects, without light.", "share"),
    "coverage": Buffer("Coverage", "Fraction of each pixel that objects cover.", "share"),
    "motion": Buffer(
        "Motion", "Motion of each point since the last frame. Grey: none.", "motion", "px"
    ),
    "ratio": Buffer(
        "Light ratio",
        "Light on real surfaces with objects over that without. Grey: no change.",
        "ratio",
    ),
    "irradiance_real": Buffer(
        "Light without objects", "Light that reaches real surfaces.", "radiance"
    ),
    "irradiance_mixed": Buffer(
        "Light with objects",
        "Light that reaches real surfaces past the objects and from them.",
        "radiance",
    ),
    "diffuse": Buffer("Diffuse light", "Light that objects scatter in all directions.", "radiance"),
    "specular": Buffer("Reflections", "Light that glossy objects reflect.", "radiance"),
    "highlight": Buffer(
        "Real reflections", "Highlights of glossy real surfaces in the video.", "radiance"
    ),
    "gloss": Buffer(
        "Change of real reflections",
        "Change of the reflections on real surfaces by objects.",
        "change",
    ),
    "tracing_level": Buffer(
        "Ray density",
        "Where real surfaces are traced: every pixel (red), every second (yellow), every fourth "
        "(blue), or none (black).",
        "label",
    ),
    "hit_distance": Buffer(
        "Reflection distance", "Distance of the surfaces that objects reflect.", "distance", "m"
    ),
    "history_length": Buffer(
        "Frames averaged", "Number of frames averaged in each pixel.", "count", "frames"
    ),
    "variance": Buffer("Noise", "Variance of each pixel before the filter.", "count"),
    "learned": Buffer(
        "Learned light", "Radiance of real surfaces as learned by the method oil.", "radiance"
    ),
}
"""Auxiliary pictures of `iprt.aovs.AOVS`."""
CUBEHELIX: Bytes = np.rint(255.0 * matplotlib.colormaps["cubehelix"](np.arange(256))[:, :3]).astype(
    np.uint8
)
"""(256, 3) colors from black to white with evenly increasing brightness."""


@dataclass(frozen=True)
class Lens:
    """The display settings of one client; only a comparison with a method renders anything.

    Attributes
    ----------
    exposure_ev : float
        Stops on top of the scene's exposure.
    curve : {"srgb", "filmic"}
    buffer : str or None
        Auxiliary picture to show instead of the picture.
    low, high : float or None
        Range of values of a scaled auxiliary picture; None for its own.
    against : str or None
        Picture to the right of `split`: `input`, the video without objects; `truth`, the
        path-traced truth of a scene view; `snapshot`, an earlier picture; or the name of a method.
    split : float
        Position of the division as a fraction of the width, from the left.
    error : bool
        Show the difference of both pictures instead of both.
    """

    exposure_ev: float = 0.0
    curve: Curve = "srgb"
    buffer: str | None = None
    low: float | None = None
    high: float | None = None
    against: str | None = None
    split: float = 0.5
    error: bool = False

    @property
    def method(self) -> str | None:
        """Name of the compared method, if any."""
        return None if self.against in ("input", "truth", "snapshot") else self.against

    def ranged(self, low: float | None, high: float | None) -> Lens:
        """Return the lens with another range of values."""
        return replace(self, low=low, high=high)

    def factor(self, exposure: float) -> float:
        """Return the scale factor of radiance in a scene of this exposure."""
        return exposure * float(2.0**self.exposure_ev)

    def develop(self, radiance: NDArray[np.float32], exposure: float) -> Bytes:
        """Convert linear radiance to (H, W, 3) uint8."""
        return developed(radiance, self.factor(exposure), self.curve)

    def color(self, name: str, values: NDArray[np.float32], exposure: float) -> Bytes:
        """Convert an auxiliary picture, (H, W) or (H, W, 3) float32, to (H, W, 3) uint8."""
        appearance = BUFFERS[name].appearance
        if appearance == "radiance":
            return self.develop(_three(values), exposure)
        if appearance == "change":
            # Middle grey means no change.
            return self.develop(_three(values) + np.float32(0.18 / self.factor(exposure)), exposure)
        if appearance in _SCALED:
            ends = value_range(self, name, values)
            return _SCALED[appearance](values, *ends) if ends else _black(values)
        return _APPEARANCES[appearance](values)

    def compare(self, ours: Bytes, other: Bytes) -> Bytes:
        """Return both side by side, or their difference; all are (H, W, 3) uint8."""
        if self.error:
            return error_map(ours, other)
        column = round(min(max(self.split, 0.0), 1.0) * ours.shape[1])
        both = ours.copy()
        both[:, column:] = other[:, column:]
        return both


def error_map(ours: Bytes, other: Bytes) -> Bytes:
    """Return the mean difference of the channels: black for none, white for `ERROR_LEVELS`."""
    difference = np.abs(ours.astype(np.int16) - other).mean(axis=2, dtype=np.float32)
    return _ramp(difference / ERROR_LEVELS)


# False colors -----------------------------------------------------------------------------------


def _three(values: NDArray[np.float32]) -> NDArray[np.float32]:
    return values if values.ndim == 3 else np.repeat(values[..., None], 3, axis=2)


def _ramp(share: NDArray[Any]) -> Bytes:
    """Map values in [0, 1] to colors; other values and NaN are clamped."""
    index = np.nan_to_num(255.0 * np.clip(share, 0.0, 1.0)).astype(np.uint8)
    colors: Bytes = CUBEHELIX[index]
    return colors


def _gray(share: NDArray[Any]) -> Bytes:
    levels: Bytes = np.rint(255.0 * np.clip(np.nan_to_num(share), 0.0, 1.0)).astype(np.uint8)
    return levels


def _black(values: NDArray[np.float32]) -> Bytes:
    return np.zeros((*values.shape[:2], 3), np.uint8)


def _distance(metres: NDArray[np.float32], low: float, high: float) -> Bytes:
    """Map distances logarithmically, near is bright; infinite or missing ones are black."""
    known = np.isfinite(metres) & (metres > 0.0)
    near, far = (np.log(max(end, 1e-6)) for end in (low, high))
    logs = np.log(np.where(known, metres, 1.0))
    share = 0.1 + 0.9 * (far - logs) / max(float(far - near), 1e-3)
    return _ramp(np.where(known, np.maximum(share, 0.1), 0.0))


def _motion(pixels: NDArray[np.float32]) -> Bytes:
    """Map motion: right is red, down is green, rest is grey, unknown is blue."""
    known = np.asarray(np.abs(pixels[..., :2]) < 1e8).all(axis=2, keepdims=True)
    share = 0.5 + 0.5 * np.clip(pixels[..., :2] / MOTION_PX, -1.0, 1.0)
    shown = np.concatenate([share, np.full_like(share[..., :1], 0.5)], axis=2)
    return _gray(np.where(known, shown, np.array([0.0, 0.0, 1.0])))


def _label(level: NDArray[np.float32]) -> Bytes:
    """Map tracing levels 0 to 2, from every pixel to every fourth in x and y; none is black."""
    colors = np.array([(240, 90, 60), (240, 200, 70), (70, 130, 200), (0, 0, 0)], np.uint8)
    return colors[np.clip(np.nan_to_num(level), 0, 3).astype(np.int64)]


def _count(values: NDArray[np.float32], low: float, high: float) -> Bytes:
    """Map counts logarithmically above `low`, which is black; `high` is white."""
    share = np.maximum(values - np.float32(low), 0.0) / np.float32(max(high - low, 1e-12))
    return _ramp(np.log1p(255.0 * share) / np.log(256.0))


def value_range(lens: Lens, name: str, values: NDArray[np.float32]) -> tuple[float, float] | None:
    """Return the lowest and highest value that false colors distinguish; None without an order."""
    appearance = BUFFERS[name].appearance
    if appearance in _FIXED:
        return _FIXED[appearance]
    if appearance not in _SCALED:
        return None
    if appearance == "distance":
        known = values[np.isfinite(values) & (values > 0.0)]
        if known.size == 0:
            return None
        low, high = (float(end) for end in np.percentile(known, (1.0, 99.0)))
    else:
        low, high = 0.0, max(float(np.nan_to_num(values).max(initial=0.0)), 1e-12)
    low, high = low if lens.low is None else lens.low, high if lens.high is None else lens.high
    return low, max(high, low + 1e-9)


_FIXED: Mapping[str, tuple[float, float]] = {"share": (0.0, 1.0), "ratio": (0.0, 2.0)}
_SCALED: Mapping[str, Callable[[NDArray[np.float32], float, float], Bytes]] = {
    "distance": _distance,
    "count": _count,
}
_APPEARANCES: Mapping[str, Callable[[NDArray[np.float32]], Bytes]] = {
    "share": lambda values: _gray(_three(values)),
    "ratio": lambda values: _gray(0.5 * _three(values)),
    "direction": lambda values: _gray(0.5 + 0.5 * _three(values)),
    "motion": _motion,
    "label": _label,
}
