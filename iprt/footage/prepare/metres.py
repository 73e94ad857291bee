"""Conversion of stored depth to metres, and detection of values that mark missing depth.

Programs mark missing depth by a special value: the largest of a type (65535), or one far outside
any scene (1e10). Such a *mark* is a single exact value that many pixels hold, far above all others.
A far wall is no mark: its distances differ from pixel to pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.files.message_text import length
from iprt.footage.prepare.enlarge import Grid
from iprt.footage.video.depth_code import DepthCode, DepthMarks, DepthSamples, cube_factor, usable

Picture = NDArray[np.float32]

BEYOND = 10.0
"""Least ratio of a mark to all other values."""
BEYOND_WHITE, BEYOND_NEAREST = 1.05, 1.5
"""Least ratio if the mark is the largest value of a type, and that is the farthest or the nearest
depth. Surfaces that come too near may all be stored as the nearest one."""
LEAST_SHARE, LEAST = 1e-4, 16
"""Least share and least number of the pixels that hold a mark."""
FEW_VALUES = 256
"""Largest number of values of quantised depth, each of which many pixels hold."""
MOST_MARKS = 3
_SAMPLES = 256
"""Number of rows and columns in which values are counted."""


@dataclass(frozen=True)
class StoredDepth:
    """Storage format of the depth pictures of a video.

    Attributes
    ----------
    size : (int, int)
        Width and height.
    grid : Grid or None
        The coarse texels that the pictures repeat.
    marks : DepthMarks
        Values that mark missing depth, given or found.
    doubts : tuple of str
        Guesses and doubts, a phrase each.
    """

    size: tuple[int, int]
    grid: Grid | None
    marks: DepthMarks
    doubts: tuple[str, ...]

    @classmethod
    def of(cls, path: Path, samples: DepthSamples, code: DepthCode) -> StoredDepth:
        """Find the storage format of a depth picture; `path` names it in messages.

        Raises
        ------
        FormatError
            See `DepthCode.decoded`.
        """
        marks, doubts = code.marks, []
        if marks is None:
            found = find_marks(samples, code)
            marks = DepthMarks(sky=tuple(mark.value for mark in found))
            doubts = [mark.line(path.name) for mark in found]
        depth = code.decoded(path, samples, marks)
        if samples.bits == 8:
            doubts += _coarse_steps(path.name, samples, code, depth)
        height, width = depth.shape
        return cls((width, height), Grid.of(depth), marks, tuple(doubts))

    def metres(self, path: Path, samples: DepthSamples, code: DepthCode) -> Picture:
        """Return metres (H, W) along the rays; 0, negative, NaN or inf where there is no surface.

        Raises
        ------
        FormatError
            See `DepthCode.decoded`.
        """
        depth = code.decoded(path, samples, self.marks)
        if code.kind == "distance":
            return depth
        if self.grid is None:
            return depth * cube_factor(*depth.shape)
        # Repeated texels must stay equal, so that they are recognised.
        width, height = self.grid.size
        return depth * self.grid.repeated(cube_factor(height, width), *depth.shape)


@dataclass(frozen=True)
class FoundMark:
    """A value taken for a mark of missing depth.

    Attributes
    ----------
    share : float
        Share of the pixels that hold it.
    below : float
        Largest of all other values.
    """

    value: float
    share: float
    below: float

    def line(self, name: str) -> str:
        """Return a line about the mark; `name` is the file's name."""
        value = f"{self.value:.9g}"
        return (
            f"depth: {value} stands in {self.share:.2%} of the pixels of {name}, far beyond all "
            f"others (up to {self.below:.6g}), and is taken for no surface: sky or a hole; list it "
            "in depth_sky (--sky) if that is right, in depth_invalid (--invalid) to have it filled "
            "in as part of a surface, or give an empty depth_sky if it is a depth"
        )


def find_marks(samples: DepthSamples, code: DepthCode) -> list[FoundMark]:
    """Find values that mark missing depth, the largest first.

    Depth of 8 bits and depth of a lossy codec have none.
    """
    found: list[FoundMark] = []
    if samples.bits == 8 or not samples.exact:
        return found
    values = samples.values
    least = max(LEAST, LEAST_SHARE * values.size)
    falls = code.ends is not None and code.ends[0] > code.ends[1]
    has_white = samples.bits > 0 or code.ends is not None
    coarse: bool | None = None
    limit = np.inf
    with np.errstate(invalid="ignore"):
        while len(found) < MOST_MARKS:
            largest = float(np.max(values, initial=0.0, where=(values < limit)))
            below = float(np.max(values, initial=0.0, where=(values < largest)))
            count = int(np.count_nonzero(values == largest))
            if below <= 0.0 or count < least:
                return found
            factor = BEYOND
            if has_white and largest >= samples.white:
                coarse = _has_few_values(samples.values) if coarse is None else coarse
                factor = BEYOND if coarse else BEYOND_NEAREST if falls else BEYOND_WHITE
            if largest < factor * below:
                return found
            found.append(FoundMark(largest, count / values.size, below))
            limit = largest
    return found


def _has_few_values(values: NDArray[np.generic]) -> bool:
    """Return whether depth (H, W) has once been quantised to 8 bits."""
    rows, columns = (slice(None, None, max(1, side // _SAMPLES)) for side in values.shape)
    return np.unique(values[rows, columns]).size <= FEW_VALUES


def _coarse_steps(name: str, samples: DepthSamples, code: DepthCode, depth: Picture) -> list[str]:
    """Return a phrase about the quantisation step at the median depth (H, W)."""
    there = usable(depth)
    if not there.any():
        return []
    middle = float(np.median(samples.values[there]))
    beside = np.array([[middle, middle + (1.0 if middle < samples.white else -1.0)]])
    here, next_to = (
        float(metres) for metres in code.metres(beside, samples.black, samples.white)[0]
    )
    return [
        f"depth: {name} has 8 bits: at the median depth, {length(here)}, one step is "
        f"{length(abs(next_to - here))}, and surfaces are as rough; give depth of 16 bits or of "
        "floats where there is any"
    ]
