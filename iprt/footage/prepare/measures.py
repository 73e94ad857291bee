"""Measures of depth, taken again in the rows that changed since the last frame."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from iprt.footage.depth_noise import plane_departure, tolerance_of
from iprt.footage.differences import differing
from iprt.footage.frame import Frame
from iprt.footage.median import MedianOfRows

Picture = NDArray[np.float32]
Rows = NDArray[np.intp]


class Measures:
    """A stage that measures a frame's depth: `OF_DEPTH`, as the frame itself would."""

    def __init__(self) -> None:
        self._depth: Picture | None = None
        self._found: dict[str, float] = {}
        self._by_rows = False  # whether the parts of measures are known, row by row

    def __call__(self, frame: Frame) -> Frame:
        """Return the frame, which knows its measures."""
        vars(frame).update(self.of(frame.depth))
        return frame

    def of(self, depth: Picture) -> dict[str, float]:
        """Return the measures of the next frame's depth (H, W)."""
        if self._depth is not depth:
            rows = self._changed(depth)
            found = self._measured(depth, rows) if len(rows) else self._found
            self._found = found or self._measured(depth, np.arange(len(depth)))
            self._depth = depth
        return self._found

    def know(self, depth: Picture, found: Mapping[str, float]) -> None:
        """Take measures of the first frame's depth that were found before."""
        self._depth, self._found = depth, dict(found)

    def _changed(self, depth: Picture) -> Rows:
        """Return the rows that differ from the last frame's; all of them at first."""
        if self._depth is not None and self._depth.shape == depth.shape:
            changed = np.flatnonzero(differing(self._depth, depth).any(axis=1))
            if self._by_rows or not len(changed):
                return changed
        self._by_rows = True
        height = len(depth)
        self._median, self._departure = MedianOfRows(height), MedianOfRows(max(height - 2, 0))
        self._finite, self._surfaces = np.zeros((2, height), np.intp)
        self._nearest, self._farthest = np.zeros((2, height), np.float32)
        return np.arange(height)

    def _measured(self, depth: Picture, rows: Rows) -> dict[str, float]:
        """Return the measures after a change of some rows; none if all rows must be looked at."""
        part = depth if len(rows) == len(depth) else depth[rows]
        finite = np.isfinite(part)
        self._finite[rows] = np.count_nonzero(finite, axis=1)
        self._nearest[rows] = part.min(axis=1)
        self._farthest[rows] = part.max(axis=1, initial=0.0, where=finite)
        nearest = float(self._nearest.min())
        median = self._median.of(part, rows, int(self._finite.sum()))
        departure = self._departed(depth, rows)
        if median is None or departure is None:
            return {}
        return {
            "median_depth": median if self._finite.any() else 1.0,
            "nearest": nearest if np.isfinite(nearest) else 0.0,
            "farthest": float(self._farthest.max()),
            "fit_tolerance": tolerance_of(departure),
        }

    def _departed(self, depth: Picture, rows: Rows) -> float | None:
        """Return the median of `plane_departure`; None as in `MedianOfRows.of`."""
        height = len(depth)
        changed = np.zeros(height, bool)
        changed[rows] = True
        middle = np.flatnonzero(changed[:-2] | changed[1:-1] | changed[2:])
        if not len(middle):
            return self._departure.of(depth[:0], middle, int(self._surfaces.sum()))
        parts = []
        for run in np.split(middle, np.flatnonzero(np.diff(middle) > 1) + 1):
            departure, self._surfaces[run] = plane_departure(depth[run[0] : run[-1] + 3], height)
            parts.append(departure)
        return self._departure.of(
            parts[0] if len(parts) == 1 else np.concatenate(parts),
            middle,
            int(self._surfaces.sum()),
        )
