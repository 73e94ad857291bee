"""Drift of a video's exposure and white balance, taken off what rays find.

A camera that sets its exposure and white balance itself multiplies all colours by the same linear
map (*Natural Environment Illumination*, section 4), which is not a change of light: light that
comes or goes changes each surface otherwise. The map of each frame to a reference frame is found
from the surfaces that both show; what rays find is mapped by it (`Frame.radiance`), so that
histories hold, and what is displayed is mapped back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from iprt.footage.color_fit import Pairs
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_texel, solid_angles
from iprt.geometry.pose import camera_motion

Picture = NDArray[np.float32]
Matrix = NDArray[np.float64]

ROWS = 256
"""Rows of the pictures that are compared, about: every n-th texel of a frame."""
CELL_ROWS = 32
"""Rows of cells, whose means are compared."""
NEARLY_WHITE = 0.95
"""Share of the radiance at which a picture's range ends from where on colours may be clipped."""
DARK_OF_WHITE, DARK_OF_MEDIAN = 0.005, 0.02
"""Radiance below which a colour is uncertain: of white where the range is limited, which eight
bits resolve coarsely, and of the picture's median."""
SAME_DEPTH = 0.1
"""Relative difference up to which a texel shows the same surface."""
SAME_PLACE = 0.5
"""Share of the sphere that shows the same surfaces in two frames of one place."""
WHOLE = 0.75
"""Share of a cell's texels that must show the same surfaces."""
MIN_SHARE = 0.05
"""Colours are compared on no less of the sphere."""
REGION = 8
"""Cells a side of the regions over which drift must be the same."""
MIN_DRIFT = 0.002
"""Relative change of colours below which a map stays as it is."""
UNEXPLAINED = 0.2
"""Share of that change that a map may leave; else it is noise, or light."""
BEYOND_NOISE = 4.0
"""Standard errors from which on what a map leaves is light."""


MEAN = np.full(3, 1.0 / 3.0, np.float32)


@dataclass(frozen=True)
class Sample:
    """Texels of a frame.

    Attributes
    ----------
    color : (h, w, 3) float32
        Linear radiance.
    depth : (h, w) float32
        Metres, +inf in open sky.
    usable : (h, w) bool
        Not clipped.
    dark : float
        Radiance below which colours are uncertain.
    pose : (4, 4) float64 or None
        `Frame.pose`.
    """

    color: Picture
    depth: Picture
    usable: NDArray[np.bool_]
    dark: float
    pose: Matrix | None

    @classmethod
    def of(cls, frame: Frame, white: float) -> Sample:
        """`white`: `FrameSource.white`."""
        step = max(1, frame.height // ROWS)
        start = step // 2
        color = frame.color[start::step, start::step]
        brightest = np.maximum(np.maximum(color[..., 0], color[..., 1]), color[..., 2])
        median = float(np.median(brightest))
        return cls(
            color=np.ascontiguousarray(color),
            depth=np.ascontiguousarray(frame.depth[start::step, start::step]),
            usable=brightest < NEARLY_WHITE * white,
            dark=max(DARK_OF_WHITE * white if np.isfinite(white) else 0.0, DARK_OF_MEDIAN * median),
            pose=frame.pose,
        )

    @property
    def legible(self) -> bool:
        """Enough of it is neither clipped nor dark."""
        seen = self.usable & (self.color @ MEAN > self.dark)
        return bool(seen.mean() >= MIN_SHARE)

    def mapped(self, color_map: Matrix | None) -> Sample:
        """The same in other colours."""
        if color_map is None:
            return self
        color = np.maximum(self.color @ color_map.T.astype(np.float32), np.float32(0.0))
        return replace(self, color=color, dark=self.dark * float(np.trace(color_map)) / 3.0)

    def seen_from(self, other: Sample) -> tuple[Sample, Picture]:
        """The nearest texels to those of `other`, and the depth at which each would show the
        same surface.
        """
        motion = camera_motion(self.pose, other.pose)
        if np.array_equal(motion, np.eye(4)[:3]):
            return self, other.depth
        height, width = other.depth.shape
        sky = ~np.isfinite(other.depth)
        d = View(width, height, projection="equirect").directions()
        points = np.where(sky, 1.0, other.depth)[..., None] * d @ motion[:, :3].T
        points += np.where(sky[..., None], 0.0, motion[:, 3])
        at = equirect_texel(points, width, height)
        sample = replace(self, color=self.color[at], depth=self.depth[at], usable=self.usable[at])
        return sample, np.where(sky, np.inf, np.linalg.norm(points, axis=-1)).astype(np.float32)


Verdict = Literal["same", "drift", "light", "noise"]


class Drift:
    """A stage of a video's stream: gives frames their `color_map`.

    The first frame is the reference, and the first after a cut. A map stays as it is until another
    one is clearly better, so that a steady video has none at all. Where the light has changed, the
    frame becomes the reference, in the colours of the first; where the camera has moved too far,
    the frame before does.

    Parameters
    ----------
    white : float
        Radiance from which on colours are clipped; infinite where they never are.
    """

    def __init__(self, white: float = np.inf) -> None:
        self._white = white
        self._reference: Sample | None = None
        self._before: Sample | None = None
        self._map: Matrix | None = None

    def __call__(self, frame: Frame) -> Frame:
        sample = Sample.of(frame, self._white)
        if sample.legible:
            self._follow(sample)
            self._before = sample.mapped(self._map)
        return frame if self._map is None else replace(frame, color_map=self._map)

    def _follow(self, sample: Sample) -> None:
        """Find the frame's map, and renew the reference where it no longer serves."""
        if self._reference is None or self._before is None:
            self._reference = sample
            return
        for reference in (self._reference, self._before):
            pairs, same_place = compare(sample, reference)
            found = None if pairs is None else pairs.fit()
            if pairs is None or found is None:
                continue
            self._reference = reference
            verdict = judged(pairs, self._map, found)
            # Since the reference, light may have changed by more than colours since the last frame.
            if verdict == "drift" or (verdict != "same" and self._drifts_from(sample, reference)):
                self._map = simplest(pairs, found)
            elif verdict == "light":
                self._reference = sample.mapped(self._map)
            return
        if same_place < SAME_PLACE:
            self._map = None
        self._reference = sample.mapped(self._map)

    def _drifts_from(self, sample: Sample, reference: Sample) -> bool:
        """Colours have drifted since the frame before, which is not the reference."""
        if self._before is None or self._before is reference:
            return False
        pairs, _ = compare(sample, self._before)
        found = None if pairs is None else pairs.fit()
        if pairs is None or found is None:
            return False
        return judged(pairs, self._map, found) == "drift"


def compare(sample: Sample, reference: Sample) -> tuple[Pairs | None, float]:
    """Colours of what both show, and the share of the sphere that shows the same surfaces in both.

    None: another place, or too little to compare.
    """
    there, expected = reference.seen_from(sample)
    same = _same_depth(there.depth, expected)
    same_place = float(np.average(same.mean(axis=1), weights=solid_angles(*same.shape[::-1])))
    if same_place < SAME_PLACE:
        return None, same_place
    side = max(1, len(same) // CELL_ROWS)
    count = _cells(same, side)
    clipped = _cells(~(sample.usable & there.usable), side)
    some = np.maximum(count, 1.0)[..., None]
    seen, wanted = (_cells(s.color * same[..., None], side) / some for s in (sample, there))
    # Cells at an edge would mix what is the same with what is not. Those that lose their brightest
    # texels would be too dark in the one that is exposed more.
    used = (count > WHOLE * side * side) & (clipped == 0.0)
    used &= (seen.mean(-1) > sample.dark) & (wanted.mean(-1) > there.dark)
    weight = np.broadcast_to(solid_angles(*used.shape[::-1])[:, None], used.shape)
    if weight[used].sum() < MIN_SHARE * weight.sum():
        return None, same_place
    row, column = np.indices(used.shape) // REGION
    region = row * (column.max() + 1) + column
    pairs = Pairs(seen[used], wanted[used], weight[used], region[used], there.dark)
    return pairs, same_place


def judged(pairs: Pairs, before: Matrix | None, found: Matrix) -> Verdict:
    """The kind of change since the map `before`; `found` is the best known map."""
    change, _ = pairs.left(np.eye(3) if before is None else before)
    if change < MIN_DRIFT:
        return "same"
    left, error = pairs.left(found)
    if left <= UNEXPLAINED * change:
        return "drift"
    return "light" if left > BEYOND_NOISE * error else "noise"


def simplest(pairs: Pairs, found: Matrix) -> Matrix | None:
    """The map that was found, or none where none is as good."""
    return None if pairs.left(np.eye(3))[0] < MIN_DRIFT else found


def _cells(picture: NDArray[Any], side: int) -> Matrix:
    """Sums over squares of texels of (h, w, ...); what is left over at the edges is not counted."""
    rows, columns = picture.shape[0] // side, picture.shape[1] // side
    whole = picture[: rows * side, : columns * side].astype(np.float32)
    # Along rows first: twice as quick as both at once.
    lines = whole.reshape(rows, side, -1).sum(axis=1)
    return np.asarray(
        lines.reshape(rows, columns, side, *picture.shape[2:]).sum(axis=2), np.float64
    )


def _same_depth(found: Picture, expected: Picture) -> NDArray[np.bool_]:
    """Where depths agree up to one factor: the scale of estimated depth wavers."""
    with np.errstate(invalid="ignore"):
        ratio = found / expected
    both = np.isfinite(ratio)
    scale = np.median(ratio[both]) if both.any() else 1.0
    near = np.abs(ratio - scale) <= SAME_DEPTH * scale
    return np.asarray(near | (np.isinf(found) & np.isinf(expected)))
