"""The stages that make a `Frame` of a video's files, in order. They are composed here alone.

1. Decode (`iprt.footage.video`): pictures as they lie in the sphere, colour as linear radiance.
2. Metres (`metres`): stored depth as metres along rays.
3. Enlarge (`enlarge`): depth at the size of colour, interpolated along surfaces.
4. Turn (`turn`): about the vertical, by `yaw_offset_deg`.

These are for each frame by itself (`reading`). In a video that must go on, good frames stand in for
what cannot be read (`steady`). `Preparation` does the rest, frame by frame:

5. Denoise (`denoise`): depth within its noise goes to the planes around.
6. Openings (`openings`): which texels without depth are windows, open sky or gaps of a surface.
7. Fill (`fill`): windows and gaps get the depth of their rim, open sky is infinitely far.
8. Exposure (`exposure`): the map of colours to those of the video's reference frame.
9. Gloss (`gloss`): the texels of glossy surfaces.
10. Clipped lights (`clipped_lights`): the light that the camera clipped.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from iprt.footage.frame import Frame
from iprt.footage.prepare.clipped_lights import ClippedLights
from iprt.footage.prepare.denoise import smoothed
from iprt.footage.prepare.exposure import Drift
from iprt.footage.prepare.fill import CleanDepth, sanitise_color, sanitise_depth
from iprt.footage.prepare.gloss import Glossy
from iprt.footage.prepare.openings import find_openings
from iprt.footage.prepare.reading import Picture, RawFrame
from iprt.footage.real_material import RealMaterial


class Preparation:
    """Stages 5 to 10 for the frames of one video, in the order in which they are given.

    Stages know what they were given before, so that each pass over a video needs a preparation of
    its own. A frame by itself is the first of its own.

    Parameters
    ----------
    white : float
        Radiance from which on colour is clipped; infinite where it never is.
    materials : tuple of RealMaterial
        The glossy real surfaces.
    drift : bool
        Whether frames get a `color_map`.
    """

    def __init__(
        self,
        white: float = math.inf,
        materials: tuple[RealMaterial, ...] = (),
        *,
        drift: bool = True,
    ) -> None:
        self._exposure = Drift(white) if drift else None
        self._gloss = Glossy(materials)
        self._lights = ClippedLights(white)
        self._stored: tuple[Picture, Picture | None] | None = None
        self._clean: CleanDepth | None = None

    def __call__(self, raw: RawFrame) -> Frame:
        """Prepare the next frame."""
        frame = self._cleaned(raw)
        if self._exposure is not None:
            frame = self._exposure(frame)
        # Materials are known by their hue, in the colours of the reference frame.
        frame = self._gloss(frame)
        return self._lights(frame).measured()

    def frames(self, raws: Iterable[RawFrame]) -> Iterator[Frame]:
        """Prepare frames one by one, when they are asked for."""
        for raw in raws:
            frame = self(raw)
            del raw  # neither may live on while the next one is made
            yield frame
            del frame

    def _cleaned(self, raw: RawFrame) -> Frame:
        """Return a frame after denoising, openings and filling.

        Depth that is that of the frame before is not filled anew: a static scene may have one
        picture of depth, a video half the rate of colour, or depth may stand in for a bad frame's.
        """
        color = sanitise_color(raw.color)
        if self._clean is None or not self._stays(raw, color):
            self._clean = sanitise_depth(smoothed(raw.depth), color)
            self._stored = raw.depth, raw.normal
        assert self._stored is not None
        depth, opening = self._clean.depth, self._clean.opening
        return Frame(color, depth, opening, self._stored[1], index=raw.index, pose=raw.pose)

    def _stays(self, raw: RawFrame, color: Picture) -> bool:
        """Return whether a frame has the depth, normals and openings of the one before."""
        assert self._clean is not None
        assert self._stored is not None
        same = all(map(_same, (raw.depth, raw.normal), self._stored))
        return same and np.array_equal(find_openings(raw.depth, color), self._clean.opening)


def _same(plane: Picture | None, other: Picture | None) -> bool:
    """Return whether planes are equal, bit for bit."""
    if plane is None or other is None:
        return plane is other
    return plane is other or np.array_equal(plane.view(np.uint32), other.view(np.uint32))
