"""Statistics of a frame's clipped lights."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from iprt.files.message_text import counted
from iprt.footage.frame import Frame
from iprt.footage.lights.groups import Clipped, groups_of
from iprt.geometry.equirect import solid_angles

MIN_REPORTED = 1.05
"""Least ratio of recovered to stored flux that is reported."""


@dataclass(frozen=True)
class Recovered:
    """Statistics of a frame's clipped lights.

    Attributes
    ----------
    lights : int
        Number of groups of clipped texels.
    area : float
        Share of the sphere that they cover.
    seen, flux : float
        Their share of the flux at the capture centre, as stored, and as recovered.
    factor : float
        Ratio of their recovered to their stored flux.
    """

    lights: int
    area: float
    seen: float
    flux: float
    factor: float

    @classmethod
    def of(cls, frame: Frame, white: float) -> Recovered | None:
        """Measure the clipped lights of a frame; None if nothing is clipped."""
        seen_frame = replace(frame, color=frame.picture, clipped=None)
        clipped = Clipped.of(seen_frame, white) if np.isfinite(white) else None
        if clipped is None:
            return None
        weight = solid_angles(frame.width, frame.height)
        texel = clipped.texel
        if frame.clipped is not None:
            texel = np.union1d(texel, frame.clipped.texel)
        at = texel // frame.width, texel % frame.width
        shares = []
        for picture in (seen_frame.color, frame.color):
            bright = picture.mean(axis=-1)
            shares.append(
                (float((weight[at[0]] * bright[at]).sum()), float(weight @ bright.sum(1)))
            )
        (seen, before), (flux, after) = shares
        return cls(
            lights=int(groups_of(seen_frame, clipped).max()),
            area=float(weight[at[0]].sum()) / (4.0 * np.pi),
            seen=seen / before,
            flux=flux / after,
            factor=flux / seen,
        )

    def line(self) -> str:
        """Return a sentence for reports."""
        what = (
            f"{counted(self.lights, 'clipped light')} in {100 * self.area:.2f}% of all directions"
        )
        if self.factor < MIN_REPORTED:
            return (
                f"{what}; taken to be as bright as the picture shows, because no visible surface "
                "shows more"
            )
        return (
            f"{what}, estimated {self.factor:.1f} times as bright as the picture shows: "
            f"{100 * self.flux:.1f}% of all light, not {100 * self.seen:.1f}%"
        )
