"""Statistics of a place from its depth: size, camera height, and implausible values.

They use depth alone, so that a wrong unit, encoding or file is noticed before rendering.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.files.message_text import length
from iprt.footage.depth_noise import fit_tolerance
from iprt.footage.normals import estimate_normals
from iprt.footage.readings import Reading, likely_reading, sparse_texels
from iprt.footage.video.depth_code import usable
from iprt.geometry.equirect import solid_angles

Float = NDArray[np.float64]

LIKELY_MEDIAN_M = (0.05, 100.0)
"""Plausible range of the median depth of places where people put objects."""
LOW_CAMERA_M, SMALL_PLACE_M = 0.25, 0.5
"""Camera height over the floor, and median depth, that are implausible if both are smaller: a
camera on a table sees farther."""
FLAT = 0.03
"""Half the thickness of a level, relative to its vertical distance from the camera."""
FLOOR_SHARE = 0.2
"""Least share of the downward directions that hit a single level, for it to be a floor."""
WIDEST_M = 1e5
"""Largest plausible extent of a place."""
MAX_DISAGREEMENT_DEG = 30.0
"""Largest plausible median angle between given normals and normals fitted to depth."""
_DOWN = 0.5
"""Least sine of the angle below the horizon of downward directions."""
_ROWS = 256
_READINGS: dict[Reading, str] = {
    "inverse": "seems to be stored as 1 / depth, high where things are near: floors and walls are "
    "flat if it is read so, and bend otherwise; store depth itself, or values from 0 to 1 with a "
    'depth_range and depth_encoding = "inverse"',
    "cube": "seems to be z-depth of a cube's six faces: floors and walls are flat if it is read so,"
    ' and bend otherwise; give --depth-kind cube (depth_kind = "cube")',
    "axis": "seems to be z-depth along the axis ahead: floors and walls are flat if it is read so, "
    "and bend otherwise; it is undefined beside the camera: store the distance along "
    "each ray, or z-depth of a cube's six faces with --depth-kind cube",
    "twice": "seems to be the distance along each ray: floors and walls are flat if it is read so, "
    'and bend otherwise; leave out depth_kind = "cube"',
}


@dataclass(frozen=True)
class DepthSummary:
    """Statistics of a place.

    Attributes
    ----------
    median_m : float
        Median depth.
    size_m : (float, float, float)
        Extent along x, y and z, without the outermost hundredths.
    floor_m : float or None
        Height of the camera over the floor; None if there is no level ground.
    reading : Reading
        The quantity that depth seems to store.
    """

    median_m: float
    size_m: tuple[float, float, float]
    floor_m: float | None
    reading: Reading

    @classmethod
    def of(cls, depth: NDArray[np.float32], *, is_cube: bool = False) -> DepthSummary | None:
        """Measure a place by a frame's depth (H, W) in metres; None if it has none.

        Parameters
        ----------
        is_cube : bool
            Whether depth was converted from depth along the axes of a cube's faces.
        """
        height, width = depth.shape
        step = -(-height // _ROWS)
        row, column, direction = sparse_texels(width, height, step)
        there = usable(depth[row, column])
        if not there.any():
            return None
        direction = direction[there]
        distance = depth[row, column][there].astype(np.float64)
        weight = solid_angles(width, height)[row[there]]
        points = direction * distance[:, None]
        ends = np.quantile(points, (0.01, 0.99), 0, weights=weight, method="inverted_cdf")
        x, y, z = map(float, ends[1] - ends[0])
        level, share = _level(points[:, 1], direction[:, 1], weight)
        return cls(
            float(np.median(distance)),
            (x, y, z),
            -level if share > FLOOR_SHARE else None,
            likely_reading(depth, is_cube=is_cube),
        )

    def line(self) -> str:
        """Return a sentence for reports."""
        x, y, z = (length(side) for side in self.size_m)
        text = f"median depth {length(self.median_m)}; about {x} wide, {z} deep, {y} high"
        if self.floor_m is not None:
            text += f"; the camera is {length(self.floor_m)} above the floor"
        return text

    def warnings(self) -> list[str]:
        """Return implausible facts, one phrase each."""
        found = []
        lowest, highest = LIKELY_MEDIAN_M
        unit = (
            "check depth_scale, the metres of one stored unit: 0.001 for millimetres, 1 for metres"
        )
        if self.median_m > highest:
            found.append(f"half of the depth is beyond {length(self.median_m)}; {unit}")
        elif self.median_m < lowest:
            found.append(f"half of the depth is nearer than {length(self.median_m)}; {unit}")
        elif (
            self.floor_m is not None
            and self.floor_m < LOW_CAMERA_M
            and self.median_m < SMALL_PLACE_M
        ):
            found.append(f"the camera is only {length(self.floor_m)} above the floor; {unit}")
        if self.median_m <= highest and max(self.size_m) > WIDEST_M:
            found.append(
                f"the place is {length(max(self.size_m))} wide; a stored value that means no "
                "surface may be read as depth: list it in depth_sky (--sky) or depth_invalid "
                f"(--invalid); or {unit}"
            )
        if self.reading != "distance":
            found.append(_READINGS[self.reading])
        return found


def normal_warnings(normal: NDArray[np.float32], depth: NDArray[np.float32]) -> list[str]:
    """Return implausible facts about normals (H, W, 3) given with depth (H, W), a phrase each."""
    there = usable(depth)
    solid = np.where(there, depth, np.float32(np.inf))
    fitted = estimate_normals(solid, np.zeros(depth.shape, np.uint8), fit_tolerance(solid))
    with np.errstate(all="ignore"):
        length = np.linalg.norm(normal, axis=-1)
        known = there & np.isfinite(length) & (length > 0.1)
        cosine = np.abs((normal * fitted).sum(axis=-1)[known] / length[known])
    if not cosine.size:
        return ["are nowhere where depth is; leave them out to have them fitted to depth"]
    angle = float(np.degrees(np.arccos(np.clip(np.median(cosine), 0.0, 1.0))))
    if angle <= MAX_DISAGREEMENT_DEG:
        return []
    return [
        f"differ from the surfaces that depth shows, by {angle:.0f}° in the median; expected world "
        "space (+X right of the picture's middle, +Y up, -Z ahead); leave them out to have them "
        "fitted to depth"
    ]


def _level(height: Float, up: Float, weight: Float) -> tuple[float, float]:
    """Find the level hit by most downward directions.

    `height` (N,) is the y of points, and `up` (N,) the y of directions. Returns the level's y, and
    its share of the weight of downward directions.
    """
    down = up < -_DOWN
    if not down.any():
        return 0.0, 0.0
    order = np.argsort(height[down])
    heights = height[down][order]
    total = np.concatenate([[0.0], np.cumsum(weight[down][order])])
    first = np.searchsorted(heights, heights * (1.0 + FLAT))
    last = np.searchsorted(heights, heights * (1.0 - FLAT), side="right")
    found = total[last] - total[first]
    best = int(found.argmax())
    return float(np.median(heights[first[best] : last[best]])), float(found[best] / total[-1])
