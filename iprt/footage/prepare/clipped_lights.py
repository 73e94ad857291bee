"""Recovery of clipped light from the shading of the surfaces that it falls on.

A picture with a white level shows a window, a lamp or the sun as white. Shadows and objects need
their true radiance. `ClippedLights` groups clipped texels into lights and estimates each light's
gain from the shading of the surfaces around it (`iprt.footage.lights`). Frames then hold the
recovered radiance, and the picture's own colors of these texels (`ClippedTexels`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from iprt.device.kept import WORTH_KEEPING, Arrays, kept
from iprt.footage.cells import Float
from iprt.footage.clipped_texels import ClippedTexels
from iprt.footage.frame import Frame
from iprt.footage.lights.gains import clip_gains
from iprt.footage.lights.groups import GROUP_ROWS, Clipped, groups_of, lights_of, ties_of
from iprt.footage.lights.shading import shading_of
from iprt.geometry.equirect import solid_angles

CHANGED = 0.3
"""Relative change of the clipped area above which gains are estimated again."""
OTHER = 0.8
"""Relative change above which the old gains are dropped at once, because the lights are others."""
MIN_CLIPPED = 0.25
"""Least clipped flux of a clipped channel, relative to the light's strongest channel."""
EVIDENCE = 25.0
"""Least twice the log-likelihood ratio at which tone mapping is assumed."""
MOST_BRIGHT = 0.05
"""Largest nearly clipped share of the sphere; beyond it, it shows walls, not lights."""
BLEND = 12
"""Number of frames over which a new estimate of the gains replaces the old one."""


@dataclass(frozen=True)
class Gains:
    """Factors between the true and the stored radiance of clipped texels.

    Attributes
    ----------
    group : (2, cells) int
        Groups of the grid's cells, for near and for far texels; 0: none.
    factor : (groups + 1, rows, 3) float32
        Factor by group and row of the picture; 1 for group 0.
    channels : (groups + 1, 3) bool
        Clipped channels of each group.
    covered : (cells,) float64
        Share of the sphere that clipped texels cover in each cell.
    exposed : (3,) float64
        `exposure_of` the frame.
    shoulder : bool
        Whether tones are mapped. `factor` then also holds in part for nearly clipped texels.
    """

    group: NDArray[np.intp]
    factor: NDArray[np.float32]
    channels: NDArray[np.bool_]
    covered: Float
    exposed: Float
    shoulder: bool = False

    def of(self, frame: Frame, clipped: Clipped) -> NDArray[np.float32]:
        """Return the factors (N, 3) of a frame's clipped texels, corrected for its exposure.

        A camera with a longer exposure clips more of a light.
        """
        clipped = clipped if self.shoulder else clipped.without_shoulder()
        group = self.group[clipped.far.astype(np.intp), clipped.cell]
        opened = (self.exposed / exposure_of(frame)).astype(np.float32)
        factor = self.factor[group, clipped.row]
        factor = np.where(factor > 1.0, np.maximum(factor * opened, 1.0), 1.0).astype(np.float32)
        share = white_share(clipped, self.channels[group])
        return np.asarray(1.0 + share * (factor - 1.0), np.float32)


def exposure_of(frame: Frame) -> Float:
    """Return the brightness (3,) of grey in the video's reference frame relative to this frame."""
    return np.ones(3) if frame.color_map is None else frame.color_map.sum(axis=1)


def covered(frame: Frame, clipped: Clipped) -> Float:
    """Return `Gains.covered` of a frame."""
    rows = min(GROUP_ROWS, frame.height)
    weight = solid_angles(frame.width, frame.height)[clipped.row] / (4.0 * np.pi)
    area = weight * clipped.share.max(-1)
    return np.asarray(np.bincount(clipped.cell, area, 2 * rows * rows), np.float64)


def recover(frame: Frame, clipped: Clipped, white: float) -> Gains:
    """Estimate the gains of a frame's lights; all 1 where its surfaces hold no evidence.

    Tone mapping is assumed where it explains the surfaces better.
    """
    plain, _ = _recovered(frame, clipped, white, shoulder=False)
    bright = clipped.with_shoulder(frame, white)
    area = covered(frame, bright).sum() - covered(frame, clipped).sum()
    if not 0.0 < area < MOST_BRIGHT:
        return plain
    # Costs are compared at the same points, none of them nearly clipped.
    _, cost = _recovered(frame, bright.without_shoulder(), white, shoulder=False)
    mapped, cost_mapped = _recovered(frame, bright, white, shoulder=True)
    return mapped if cost_mapped < cost - EVIDENCE else plain


def recover_once(frame: Frame, clipped: Clipped, white: float) -> Gains:
    """Return `recover`, which is kept for large panoramas (`iprt.device.kept`)."""
    if frame.depth.size < WORTH_KEEPING:
        return recover(frame, clipped, white)

    def make() -> Arrays:
        gains = recover(frame, clipped, white)
        return vars(gains) | {"shoulder": np.array(gains.shoulder)}

    found = dict(kept("gains", __name__, [frame, white], make))
    shoulder = bool(found.pop("shoulder"))
    return Gains(**found, shoulder=shoulder)


def _recovered(
    frame: Frame, clipped: Clipped, white: float, *, shoulder: bool
) -> tuple[Gains, float]:
    """Return gains, and the cost of the fit (`ClipGains.cost`)."""
    cell_groups = groups_of(frame, clipped)
    count = int(cell_groups.max()) + 1
    factor = np.ones((count, frame.height, 3), np.float32)
    area = covered(frame, clipped.without_shoulder())
    group = cell_groups[clipped.far.astype(np.intp), clipped.cell]
    flux = np.stack([_flux(frame, clipped, group == number) for number in range(count)])
    channels = flux > MIN_CLIPPED * flux.max(axis=1, keepdims=True)
    clipped = replace(clipped, share=white_share(clipped, channels[group]))
    lights = lights_of(frame, clipped, cell_groups)
    shading = shading_of(frame, clipped, group, lights, white) if lights else None
    cost = 0.0
    if shading is not None:
        shares = np.stack([light.share(frame.height) for light in lights], axis=-1)
        present = np.stack([channels[light.group] for light in lights])
        found = clip_gains(shading, ties_of(lights), present)
        for index, light in enumerate(lights):
            more = shares[:, index, None] * (found.gain[index] - 1.0)
            factor[light.group] += more.astype(np.float32)
        cost = found.cost
    return Gains(cell_groups, factor, channels, area, exposure_of(frame), shoulder), cost


def white_share(clipped: Clipped, channels: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return (N, 3) the clipped share of texels: the least over all clipped `channels` (N, 3).

    Where one of these is not clipped, the others have lost little. A larger share would brighten
    the rims of lights.
    """
    lowest = np.where(channels, clipped.share, np.float32(1.0)).min(axis=-1, keepdims=True)
    return np.where(channels, lowest, np.float32(0.0))


def _flux(frame: Frame, clipped: Clipped, chosen: NDArray[np.bool_]) -> Float:
    """Return the clipped flux (3,) at the capture centre of chosen texels, as stored."""
    weight = solid_angles(frame.width, frame.height)[clipped.row[chosen], None]
    color = frame.color.reshape(-1, 3)[clipped.texel[chosen]]
    return np.asarray((weight * color * clipped.share[chosen]).sum(0), np.float64)


class ClippedLights:
    """A stage that recovers the radiance of clipped texels.

    Gains are estimated in the first frame with clipped texels, and hold while the clipped area
    stays. Where much of it appears or disappears, they are estimated again and blended in.

    Parameters
    ----------
    white : float
        Linear radiance at which the camera's channels clip; infinite: never.
    """

    def __init__(self, white: float) -> None:
        self._white = white
        self._gains: Gains | None = None
        self._before: Gains | None = None
        self._blended = 0

    def __call__(self, frame: Frame) -> Frame:
        """Return the frame with recovered radiance, or itself if nothing is clipped."""
        clipped = Clipped.of(frame, self._white) if np.isfinite(self._white) else None
        if clipped is None:
            return frame
        gains = self._at(frame, clipped)
        if any(part.shoulder for part, _ in gains):
            clipped = clipped.with_shoulder(frame, self._white)
        # Gains are blended in logarithms.
        gain = np.prod([part.of(frame, clipped) ** share for part, share in gains], axis=0)
        brighter = (gain != 1.0).any(axis=-1)
        if not brighter.any():
            return frame
        texel = clipped.texel[brighter]
        light = frame.color.copy()
        seen = light.reshape(-1, 3)[texel]
        light.reshape(-1, 3)[texel] = seen * gain[brighter]
        return frame.recolored(color=light, clipped=ClippedTexels(texel.astype(np.int32), seen))

    def _at(self, frame: Frame, clipped: Clipped) -> list[tuple[Gains, np.float32]]:
        """Return the gains in effect, each with its weight."""
        if self._gains is None:
            self._gains = recover_once(frame, clipped, self._white)
        elif self._before is None:
            change = _change(self._gains.covered, covered(frame, clipped))
            if change > CHANGED:
                self._before = None if change > OTHER else self._gains
                self._gains, self._blended = recover(frame, clipped, self._white), 0
        now = self._gains
        if self._before is None:
            return [(now, np.float32(1.0))]
        self._blended += 1
        share = np.float32(self._blended / BLEND)
        before = self._before
        if self._blended == BLEND:
            self._before = None
        return [(before, 1 - share), (now, share)]


def _change(before: Float, after: Float) -> float:
    """Return the relative difference of two areas, in [0, 1]."""
    both = np.maximum(before, after).sum()
    return float(np.abs(after - before).sum() / both) if both > 0.0 else 0.0
