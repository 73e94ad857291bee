"""Surfaces on which patches of sunlight are looked for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from iprt.footage.albedo_segments import well_seen
from iprt.footage.cell_rays import leaves
from iprt.footage.cells import Cells, Float, cell_means
from iprt.footage.found_sun.local_mean import LocalMean
from iprt.footage.frame import LUMINANCE, Frame
from iprt.footage.threads import on_all_cores

Floats = NDArray[np.float32]

WIDTH = np.deg2rad(7.0)
"""Width of the local means: shading varies more slowly, and patches have borders within it."""
LIFT = 0.005
"""Offset of receivers from their surface, relative to depth. Four times as much moves patches by
half a degree of the sun."""
LOWEST = 0.05
"""Least cosine between a receiver's normal and the sun."""
DARK = 1e-3
"""Radiance relative to the median below which noise corrupts a logarithm."""


@dataclass(frozen=True)
class Receivers:
    """Surfaces on which patches of sunlight are looked for.

    Attributes
    ----------
    cells, occluders : Cells
        N cells, and the ones that block rays.
    start : (N, 3) float64
        Origins of rays in metres.
    color : (N, 3) float64
        Mean radiance.
    usable : (N,) bool
        Cells that show one diffuse surface, not clipped and not black.
    steps : int
        Points at which rays are tested.
    """

    cells: Cells
    occluders: Cells
    start: Float
    color: Float
    usable: NDArray[np.bool_]
    steps: int

    @classmethod
    def of(cls, frame: Frame, cells: Cells, occluders: Cells, steps: int) -> Receivers:
        """Build them from a frame and its cells."""
        color = cell_means(frame.radiance, cells.rows).reshape(-1, 3)
        usable = well_seen(cells) & (color.min(-1) > DARK * np.median(color))
        usable &= cell_means(spoilt(frame), cells.rows).ravel() == 0.0
        start = cells.point + LIFT * cells.depth[:, None] * cells.normal
        return cls(cells, occluders, start, color, usable, steps)

    @cached_property
    def mean(self) -> LocalMean:
        """Means over cells nearby."""
        return LocalMean(self.cells.rows, WIDTH)

    def facing(self, direction: Float) -> tuple[Float, Floats]:
        """Return the cosines (N,) with a direction, and the solid angles of usable cells facing it.

        Other cells have the solid angle 0.
        """
        cosine = self.cells.normal @ direction
        faces = self.usable & (cosine > LOWEST)
        return cosine, np.where(faces, self.cells.solid_angle, 0.0).astype(np.float32)

    def lit(self, direction: Float) -> Floats:
        """Return the cosine (N,) of a distant light where it reaches usable cells, else 0."""
        cosine = self.cells.normal @ direction
        there = np.flatnonzero(self.usable & (cosine > LOWEST))
        result = np.zeros(len(cosine), np.float32)
        way = np.broadcast_to(direction, (len(there), 3))
        result[there] = cosine[there] * leaves(self.occluders, self.start[there], way, self.steps)
        return result

    def correlations(self, directions: Float) -> Floats:
        """Return the correlation (D,) of each direction's light with the picture."""
        lit = np.stack(on_all_cores(self.lit, directions), axis=-1)
        faces = self.usable[:, None] & (self.cells.normal @ directions.T > LOWEST)
        weight = np.where(faces, self.cells.solid_angle[:, None], 0.0).astype(np.float32)
        seen = np.log(np.maximum(self.color @ LUMINANCE, 1e-30)).astype(np.float32)
        light = lit - self.mean(lit, weight)
        shown = seen[:, None] - self.mean(np.where(faces, seen[:, None], 0.0), weight)
        both, own, other = (
            (weight * part).sum(axis=0) for part in (light * shown, light**2, shown**2)
        )
        return np.asarray(both / np.sqrt(np.maximum(own * other, 1e-20)))


def spoilt(frame: Frame) -> NDArray[np.bool_]:
    """Return texels (H, W) whose picture is no diffuse radiance: mirrors, and clipped lights."""
    metals = [i + 1 for i, one in enumerate(frame.real_materials) if one.kind != "plastic"]
    none = np.zeros(frame.depth.shape, bool)
    spoilt = none if frame.gloss is None else np.isin(frame.gloss, metals)
    if frame.clipped is not None:
        spoilt.ravel()[frame.clipped.texel] = True
    return spoilt
