"""Clipped lights of a frame in numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from iprt.files.wording import counted
from iprt.footage.frame import Frame
from iprt.footage.lights.groups import Clipped, groups_of
from iprt.geometry.equirect import solid_angles

MIN_REPORTED = 1.05
"""Factor by which lights are brighter than they look, from which on it is reported."""


@dataclass(frozen=True)
class Recovered:
    """The clipped lights of a frame in numbers.

    Attributes
    ----------
    lights : int
        Groups of clipped texels.
    area : float
        Share of all directions that they cover.
    seen, flux : float
        Share of the flux at the capture centre that comes from them as they look, and as recovered.
    factor : float
        Their flux as recovered over that as they look.
    """

    lights: int
    area: float
    seen: float
    flux: float
    factor: float

    @classmethod
    def of(cls, frame: Frame, white: float) -> Recovered | None:
        """None where nothing is clipped."""
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
        """As text."""
        what = (
            f"{counted(self.lights, 'clipped light')} in {100 * self.area:.2f}% of all directions"
        )
        if self.factor < MIN_REPORTED:
            return (
                f"{what}; taken to be as bright as the picture shows, because no surface in sight "
                "shows more"
            )
        return (
            f"{what}, estimated {self.factor:.1f} times as bright as the picture shows: "
            f"{100 * self.flux:.1f}% of all light, not {100 * self.seen:.1f}%"
        )
