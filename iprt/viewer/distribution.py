"""Distributions of displayed values: range, histogram and color bar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.output.display import Bytes
from iprt.viewer.lens import BUFFERS, Lens, value_range

BINS = 64
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Weights of linear Rec.709 in luminance (ITU-R BT.709)."""
STOPS = -10.0, 4.0
"""Range of a picture's histogram, in stops above white."""


@dataclass(frozen=True, eq=False)
class Distribution:
    """The distribution of a displayed picture's values.

    Attributes
    ----------
    low, high : float
        Ends of the histogram and of the color bar.
    unit : str
    counts : (BINS,) int64
        Pixels per bin, from `low` to `high`; values beyond count at the ends.
    colors : (BINS, 3) uint8
        Displayed colors of the bins' middles.
    scaled : bool
        True if the colors follow the range, which may be changed then.
    """

    low: float
    high: float
    unit: str
    counts: NDArray[np.int64]
    colors: Bytes
    scaled: bool

    @property
    def ends(self) -> tuple[str, str]:
        """The ends in words."""
        low, high = (f"{end:.4g} {self.unit}".rstrip() for end in (self.low, self.high))
        return low, high


def distribution(
    lens: Lens, name: str | None, values: NDArray[np.float32], exposure: float
) -> Distribution | None:
    """Return the distribution of an auxiliary picture, or of the picture; None if it has no order.

    Parameters
    ----------
    lens : Lens
    name : str or None
        Name of the auxiliary picture; None for the picture, which is counted by luminance.
    values : (H, W) or (H, W, 3) float32
        Values of channels are averaged.
    exposure : float
        The scene's.
    """
    if name is None:
        low, high = STOPS
        middles = _middles(low, high)
        white = np.float32(1.0 / lens.factor(exposure))
        with np.errstate(divide="ignore", invalid="ignore"):
            stops = np.log2(values @ LUMINANCE / white)
        grey = (np.exp2(middles) * white).astype(np.float32)
        colors = lens.develop(np.repeat(grey[None, :, None], 3, axis=2), exposure)[0]
        return Distribution(low, high, "EV", _counts(stops, low, high), colors, scaled=False)
    ends = value_range(lens, name, values)
    if ends is None:
        return None
    buffer = BUFFERS[name]
    if values.ndim == 3:
        values = values.mean(axis=2)
    middles = _middles(*ends)
    colors = lens.ranged(*ends).color(name, middles[None].astype(np.float32), exposure)[0]
    return Distribution(*ends, buffer.unit, _counts(values, *ends), colors, scaled=buffer.scaled)


def _middles(low: float, high: float) -> NDArray[np.float64]:
    return low + (high - low) * (np.arange(BINS) + 0.5) / BINS


def _counts(values: NDArray[np.float32], low: float, high: float) -> NDArray[np.int64]:
    known = values[np.isfinite(values) | np.isneginf(values)]
    return np.histogram(np.clip(known, low, high), BINS, (low, high))[0].astype(np.int64)
