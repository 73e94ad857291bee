"""Light from outside, with which frames of a video are rendered."""

from __future__ import annotations

from dataclasses import dataclass

from iprt.footage.found_sun.disc import without_disc
from iprt.footage.found_sun.patches import SunPatches
from iprt.footage.frame import Frame
from iprt.footage.sky import Sky
from iprt.footage.sun import Sun


@dataclass(frozen=True, eq=False)
class Daylight:
    """The light from outside that reaches the frames of a video.

    Attributes
    ----------
    sun : Sun or None
        The sun of the first frame.
    patches : SunPatches or None
        Its patches, which tell its brightness in other frames; None: it is the same in all.
    sky : Sky or None
        The sky behind windows, where no camera saw it.
    """

    sun: Sun | None = None
    patches: SunPatches | None = None
    sky: Sky | None = None

    def on(self, frame: Frame) -> Frame:
        """Return a frame in this light. The disc of the sun is no part of its other light."""
        sun, sky = self.sun, self.sky
        if sun is not None:
            if self.patches is not None:
                sun = sun.dimmed(self.patches.share(frame.color))
            frame = without_disc(frame.recolored(sun=sun), sun.seen_from(frame.pose))
        if sky is not None and frame.opening.any():
            frame = frame.recolored(sky=sky.seen_from(frame.pose))
        return frame
