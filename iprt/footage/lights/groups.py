"""Grouping of clipped texels into lights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.footage.cells import Float
from iprt.footage.components import components
from iprt.footage.frame import Frame
from iprt.footage.lights.gains import Tie
from iprt.geometry.equirect import solid_angles

NEARLY, FULLY = 0.95, 0.98
"""Shares of the white level at which a channel begins to count as clipped, and counts fully. Codecs
leave no clipped texel exactly at white."""
SHOULDER = 0.8
"""Share of the white level above which tone mapping may compress radiance."""
GROUP_ROWS = 128
"""Rows of the grid on which clipped texels are joined into lights, across gaps of two cells."""
LARGEST = 6
"""Number of groups of a kind with lights of their own; all other groups are one."""
KNOTS_DEG = (-25.0, -8.0, 8.0, 25.0, 50.0)
"""Elevations of the knots between which the gain of distant light varies, behind windows or in the
open: there is ground below the horizon, and skies are uneven. A surface has a single gain."""
MIN_SHARE = 0.02
"""Least share of a group's clipped flux that makes a part of it a light of its own."""
SAME_SIDE, ACROSS_HORIZON, SAME_ELEVATION = 0.6, 1.5, 0.7
"""Expected spread of log-gains between parts of distant light: in one window, on the same side of
the horizon, or on both; and in two windows at one elevation."""


@dataclass(frozen=True)
class Clipped:
    """The N clipped texels of a frame.

    Attributes
    ----------
    texel : (N,) int
        Row * width + column, ascending.
    level : (N, 3) float32
        Radiance over the white level.
    share : (N, 3) float32
        Degree of clipping of each channel, in [0, 1], rising from `NEARLY`. With tone mapping, at
        least the degree of the texel's darkest channel, rising from `SHOULDER`.
    far : (N,) bool
        Whether the texel shows distant light: behind an opening, or in the open sky.
    cell : (N,) int
        Cell in the grid of `GROUP_ROWS`.
    row : (N,) int
        Row of the picture.
    """

    texel: NDArray[np.intp]
    level: NDArray[np.float32]
    share: NDArray[np.float32]
    far: NDArray[np.bool_]
    cell: NDArray[np.intp]
    row: NDArray[np.intp]

    @classmethod
    def of(cls, frame: Frame, white: float) -> Clipped | None:
        """Find the clipped texels of a frame; None if no channel reaches white."""
        # Compare all channels at once, then find the texels that they belong to.
        channel = np.flatnonzero(frame.color >= NEARLY * white)
        if not (channel.size and frame.color.max() >= FULLY * white):
            return None
        texel = channel // 3
        return cls._of_texels(frame, white, texel[np.diff(texel, prepend=-1) > 0])

    @classmethod
    def _of_texels(cls, frame: Frame, white: float, texel: NDArray[np.intp]) -> Clipped:
        level = frame.color.reshape(-1, 3)[texel] / np.float32(white)
        return cls(
            texel,
            level,
            _ramp(level, NEARLY),
            frame.opening.ravel()[texel] | ~np.isfinite(frame.depth.ravel()[texel]),
            grid_cells(frame, texel, min(GROUP_ROWS, frame.height)),
            texel // frame.width,
        )

    def with_shoulder(self, frame: Frame, white: float) -> Clipped:
        """Add the texels of the same frame that tone mapping may compress."""
        bright = (frame.color >= np.float32(SHOULDER * white)).all(axis=-1)
        both = self._of_texels(frame, white, np.union1d(self.texel, np.flatnonzero(bright)))
        darkest = _ramp(both.level.min(axis=-1, keepdims=True), SHOULDER)
        return replace(both, share=np.maximum(both.share, darkest))

    def without_shoulder(self) -> Clipped:
        """Return the same texels; texels that are not clipped have share 0."""
        return replace(self, share=_ramp(self.level, NEARLY))


def _ramp(level: NDArray[np.float32], start: float) -> NDArray[np.float32]:
    """Return the degree of clipping of levels, rising from 0 at `start`."""
    share = np.clip((level - start) / (FULLY - start), 0.0, 1.0)
    return np.asarray(share, np.float32)


def grid_cells(frame: Frame, texel: NDArray[np.intp], rows: int) -> NDArray[np.intp]:
    """Return the grid cells that contain texels."""
    row, column = texel // frame.width, texel % frame.width
    return np.asarray(row * rows // frame.height * 2 * rows + column * 2 * rows // frame.width)


@dataclass(frozen=True)
class Light:
    """A part of the clipped texels with a gain of its own.

    Attributes
    ----------
    group : int
        Group index, at least 1.
    knots_deg : tuple of float
        Elevations of the knots of all lights of the group, ascending; a single one for surfaces.
    knot : int
        Index of the light's knot; its share falls to 0 at the neighbouring knots.
    far : bool
        Whether the light is distant; see `Clipped.far`.
    """

    group: int
    knots_deg: tuple[float, ...]
    knot: int
    far: bool

    def share(self, rows: int) -> Float:
        """Return the share (rows,) of the light in each row of an equirect picture."""
        elevation = 90.0 - (np.arange(rows) + 0.5) / rows * 180.0
        own = np.eye(len(self.knots_deg))[self.knot]
        return np.asarray(np.interp(elevation, self.knots_deg, own))


def groups_of(frame: Frame, clipped: Clipped) -> NDArray[np.intp]:
    """Label `Gains.group`: connected clipped texels, near and far ones separately.

    Near groups come first, each kind in descending order of flux. Gaps of two cells are bridged, so
    that the panes of a window form one group. Groups without a fully clipped texel are dropped.
    """
    rows = min(GROUP_ROWS, frame.height)
    cells = 2 * rows * rows
    weight = solid_angles(frame.width, frame.height)[clipped.row] * clipped.share.sum(-1)
    result, last = np.zeros((2, cells), np.intp), 0
    for kind in (0, 1):
        own = (clipped.far == bool(kind)) & (clipped.share > 0.0).any(axis=-1)
        if not own.any():
            continue
        hot = np.bincount(clipped.cell[own], minlength=cells).reshape(rows, 2 * rows) > 0
        hot = np.pad(hot, ((0, 0), (1, 1)), "wrap")
        around = scipy.ndimage.binary_dilation(hot, np.ones((3, 3)))
        near = around[:, 1:-1]
        label, count = components(near)
        of_texel = label.ravel()[clipped.cell[own]]
        flux = np.bincount(of_texel, weight[own], count)
        full = np.bincount(of_texel, (clipped.share[own] == 1.0).any(-1), count) > 0
        order = [j for j in np.argsort(-flux, kind="stable") if full[j]]
        number = np.zeros(count, np.intp)
        for rank, j in enumerate(order):
            number[j] = last + 1 + min(rank, LARGEST)
        last += min(len(order), LARGEST + 1)
        result[kind] = np.where(near.ravel(), number[label.ravel()], 0)
    return result


def lights_of(frame: Frame, clipped: Clipped, group: NDArray[np.intp]) -> list[Light]:
    """Return the lights of all groups, in the order of the groups."""
    own = group[clipped.far.astype(np.intp), clipped.cell]
    weight = solid_angles(frame.width, frame.height)[clipped.row] * clipped.share.sum(-1)
    lights = []
    for number in range(1, int(group.max()) + 1):
        inside = own == number
        far = bool(clipped.far[inside][0])
        knots: tuple[float, ...] = KNOTS_DEG if far else (0.0,)
        flux = np.bincount(clipped.row[inside], weight[inside], frame.height)
        shares = [
            Light(number, knots, k, far).share(frame.height) @ flux for k in range(len(knots))
        ]
        enough = np.array(shares) >= MIN_SHARE * sum(shares)
        knots = tuple(knot for knot, has in zip(knots, enough, strict=True) if has)
        lights += [Light(number, knots, k, far) for k in range(len(knots))]
    return lights


def ties_of(lights: Sequence[Light]) -> list[Tie]:
    """Return the pairs of distant lights that are expected to have similar gains."""
    ties = []
    for i, a in enumerate(lights):
        for j, b in enumerate(lights[:i]):
            if a.far and b.far and a.group == b.group and a.knot == b.knot + 1:
                one_side = a.knots_deg[a.knot] * b.knots_deg[b.knot] > 0.0
                ties.append((i, j, SAME_SIDE if one_side else ACROSS_HORIZON))
            elif a.far and b.far and a.knots_deg[a.knot] == b.knots_deg[b.knot]:
                ties.append((i, j, SAME_ELEVATION))
    return ties
