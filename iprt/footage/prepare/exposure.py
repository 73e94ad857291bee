"""Compensation of drift of a video's exposure and white balance.

Automatic exposure and white balance multiply all colors by the same linear map (*Natural
Environment Illumination*, section 4). A change of light differs: it changes each surface by another
factor. The map of each frame to a reference frame is estimated from the surfaces that both show.
Radiance for rays is mapped by it (`Frame.radiance`), so that temporal histories stay valid. It is
mapped back for display.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from iprt.footage.cells import cell_sums, cell_texels
from iprt.footage.color_fit import Pairs
from iprt.footage.frame import Frame
from iprt.footage.median import median_of_smallest
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_texel, solid_angles
from iprt.geometry.pose import camera_motion

Picture = NDArray[np.float32]
Matrix = NDArray[np.float64]

ROWS = 256
"""Approximate number of rows of the compared pictures: every n-th texel of a frame."""
CELL_ROWS = 32
"""Number of rows of cells, whose means are compared."""
NEARLY_WHITE = 0.95
"""Share of the clipping radiance above which colors may be clipped."""
DARK_OF_WHITE, DARK_OF_MEDIAN = 0.005, 0.02
"""Radiance below which a color is uncertain: relative to white where the range is limited, because
eight bits resolve it coarsely, and relative to the picture's median."""
SAME_DEPTH = 0.1
"""Largest relative difference in depth of texels that show the same surface."""
SAME_PLACE = 0.5
"""Least share of the sphere with the same surfaces in two frames of one place."""
WHOLE = 0.75
"""Least share of a cell's texels with the same surfaces."""
MIN_SHARE = 0.05
"""Least share of the sphere on which colors are compared."""
REGION = 8
"""Width, in cells, of the regions over which drift must be the same."""
MIN_DRIFT = 0.002
"""Least relative change of colors that changes the map."""
UNEXPLAINED = 0.2
"""Largest share of that change left unexplained by a map; beyond it, it is noise or light."""
BEYOND_NOISE = 4.0
"""Residual of a map, in standard errors, above which it is a change of light."""


MEAN = np.full(3, 1.0 / 3.0, np.float32)


@dataclass(frozen=True)
class Sample:
    """Texels sampled from a frame.

    Attributes
    ----------
    color : (h, w, 3) float32
        Linear radiance.
    depth : (h, w) float32
        Metres, +inf in open sky.
    usable : (h, w) bool
        Whether the color is not clipped.
    dark : float
        Radiance below which colors are uncertain.
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
        """Sample a frame; `white` is `FrameSource.white`."""
        step = max(1, frame.height // ROWS)
        start = step // 2
        color = frame.color[start::step, start::step]
        brightest = np.maximum(np.maximum(color[..., 0], color[..., 1]), color[..., 2])
        median = median_of_smallest(brightest, brightest.size)
        return cls(
            color=np.ascontiguousarray(color),
            depth=np.ascontiguousarray(frame.depth[start::step, start::step]),
            usable=brightest < NEARLY_WHITE * white,
            dark=max(DARK_OF_WHITE * white if np.isfinite(white) else 0.0, DARK_OF_MEDIAN * median),
            pose=frame.pose,
        )

    @property
    def legible(self) -> bool:
        """Return whether enough texels are neither clipped nor dark."""
        seen = self.usable & (self.color @ MEAN > self.dark)
        return bool(seen.mean() >= MIN_SHARE)

    def mapped(self, color_map: Matrix | None) -> Sample:
        """Return the sample in other colors."""
        if color_map is None:
            return self
        color = np.maximum(self.color @ color_map.T.astype(np.float32), np.float32(0.0))
        return replace(self, color=color, dark=self.dark * float(np.trace(color_map)) / 3.0)

    def seen_from(self, other: Sample) -> tuple[Sample, Picture]:
        """Look up the texels nearest to those in `other`.

        Returns the texels, and the depth at which each would show the same surface.
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
    """A stage that sets the `color_map` of frames.

    The reference is the first frame of the video, and the first one after a cut. A map stays until
    another one is clearly better, so a steady video has no maps. Where the light has changed, the
    current frame becomes the reference, in the colors of the first one. Where the camera has moved
    too far, the previous frame does.

    Parameters
    ----------
    white : float
        Radiance at which colors clip; infinite if they never do.
    """

    def __init__(self, white: float = np.inf) -> None:
        self._white = white
        self._reference: Sample | None = None
        self._before: Sample | None = None
        self._map: Matrix | None = None

    def __call__(self, frame: Frame) -> Frame:
        """Return the frame with its `color_map`, or itself if colors have not drifted."""
        sample = Sample.of(frame, self._white)
        if sample.legible:
            self._follow(sample)
            self._before = sample.mapped(self._map)
        return frame if self._map is None else frame.recolored(color_map=self._map)

    def _follow(self, sample: Sample) -> None:
        """Estimate the frame's map, and replace the reference where it no longer serves."""
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
            # Light may have changed since the reference, but only colors since the last frame.
            if verdict == "drift" or (verdict != "same" and self._drifts_from(sample, reference)):
                # The identity stands where it fits as well.
                self._map = None if pairs.left(np.eye(3))[0] < MIN_DRIFT else found
            elif verdict == "light":
                self._reference = sample.mapped(self._map)
            return
        if same_place < SAME_PLACE:
            self._map = None
        self._reference = sample.mapped(self._map)

    def _drifts_from(self, sample: Sample, reference: Sample) -> bool:
        """Return whether colors drifted since the previous frame, if that is not the reference."""
        if self._before is None or self._before is reference:
            return False
        pairs, _ = compare(sample, self._before)
        found = None if pairs is None else pairs.fit()
        if pairs is None or found is None:
            return False
        return judged(pairs, self._map, found) == "drift"


def compare(sample: Sample, reference: Sample) -> tuple[Pairs | None, float]:
    """Pair the colors of surfaces that both show.

    Returns the pairs, and the share of the sphere that shows the same surfaces in both. The pairs
    are None for another place, or if there is too little to compare.
    """
    there, expected = reference.seen_from(sample)
    same = _same_depth(there.depth, expected)
    same_place = float(np.average(same.mean(axis=1), weights=solid_angles(*same.shape[::-1])))
    if same_place < SAME_PLACE:
        return None, same_place
    rows = min(CELL_ROWS, len(same))
    count = cell_sums(same, rows)
    clipped = cell_sums(~(sample.usable & there.usable), rows)
    some = np.maximum(count, 1.0)[..., None]
    seen, wanted = (cell_sums(s.color * same[..., None], rows) / some for s in (sample, there))
    # Cells at an edge would mix different surfaces. Cells with clipped texels would lose their
    # brightest texels in one picture, and be too dark there.
    used = (count > WHOLE * cell_texels(same.shape, rows)) & (clipped == 0.0)
    used &= (seen.mean(-1) > sample.dark) & (wanted.mean(-1) > there.dark)
    weight = np.broadcast_to(solid_angles(*used.shape[::-1])[:, None], used.shape)
    if weight[used].sum() < MIN_SHARE * weight.sum():
        return None, same_place
    row, column = np.indices(used.shape) // REGION
    region = row * (column.max() + 1) + column
    pairs = Pairs(seen[used], wanted[used], weight[used], region[used], there.dark)
    return pairs, same_place


def judged(pairs: Pairs, before: Matrix | None, found: Matrix) -> Verdict:
    """Classify the change since the map `before`, given the best map `found`."""
    change, _ = pairs.left(np.eye(3) if before is None else before)
    if change < MIN_DRIFT:
        return "same"
    left, error = pairs.left(found)
    if left <= UNEXPLAINED * change:
        return "drift"
    return "light" if left > BEYOND_NOISE * error else "noise"


def _same_depth(found: Picture, expected: Picture) -> NDArray[np.bool_]:
    """Return where depths agree up to one factor, as the scale of estimated depth wavers."""
    with np.errstate(invalid="ignore"):
        ratio = found / expected
    both = np.isfinite(ratio)
    scale = np.median(ratio[both]) if both.any() else 1.0
    near = np.abs(ratio - scale) <= SAME_DEPTH * scale
    return np.asarray(near | (np.isinf(found) & np.isinf(expected)))
