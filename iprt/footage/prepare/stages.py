"""Stages that turn the files of a video into `Frame` objects, in order.

1. Decode (`iprt.footage.video`): place pictures on the sphere, convert color to linear radiance.
2. Metres (`metres`): convert stored depth to metres along rays.
3. Enlarge (`enlarge`): resample depth to the size of color, along surfaces.
4. Turn (`turn`): rotate about the vertical by `yaw_offset_deg`.

`reading` runs stages 1 to 4 on each frame separately. `steady` replaces unreadable frames by good
ones. `Preparation` runs the other stages, frame by frame:

5. Denoise (`denoise`): project noisy depth onto the planes fitted around it.
6. Openings (`openings`): sort texels without depth into windows, open sky and gaps in surfaces.
7. Fill (`fill`): interpolate depth over windows and gaps from their rim; open sky is infinite.
8. Exposure (`exposure`): estimate the map of colors to the video's reference frame.
9. Gloss (`gloss`): mark the texels of glossy surfaces.
10. Clipped lights (`clipped_lights`): recover the radiance that the camera clipped.
11. Daylight (`iprt.footage.daylight`): dim a known sun behind clouds, and take its disc from the
    light; turn a known sky to the axes of the frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from iprt.device.kept import WORTH_KEEPING, Arrays, kept
from iprt.footage.daylight import Daylight
from iprt.footage.frame import OF_DEPTH, Frame
from iprt.footage.prepare.clipped_lights import ClippedLights
from iprt.footage.prepare.denoise import Noise, smoothed
from iprt.footage.prepare.exposure import Drift
from iprt.footage.prepare.fill import CleanDepth, Filling, sanitize_color, sanitize_depth
from iprt.footage.prepare.gloss import Glossy
from iprt.footage.prepare.measures import Measures
from iprt.footage.prepare.reading import Picture, RawFrame
from iprt.footage.real_material import RealMaterial
from iprt.footage.video.depth_code import usable


class Preparation:
    """Stages 5 to 11 for the frames of one video, in the order in which they are given.

    The stages keep state from frame to frame, so each pass over a video needs its own preparation.
    A single frame is the first one of its own preparation.

    Parameters
    ----------
    white : float
        Radiance at which color clips; infinite if it never does.
    materials : tuple of RealMaterial
        The glossy real surfaces.
    drift : bool
        Whether to estimate the `color_map` of frames.
    daylight : Daylight or None
        Light from outside; None for none.
    """

    def __init__(
        self,
        white: float = math.inf,
        materials: tuple[RealMaterial, ...] = (),
        *,
        drift: bool = True,
        daylight: Daylight | None = None,
    ) -> None:
        self._daylight = daylight or Daylight()
        self._exposure = Drift(white) if drift else None
        self._gloss = Glossy(materials)
        self._lights = ClippedLights(white)
        self._noise, self._filling, self._measures = Noise(), Filling(), Measures()
        self._last: tuple[Picture, Picture | None, CleanDepth] | None = None

    def __call__(self, raw: RawFrame) -> Frame:
        """Prepare the next frame."""
        frame = self._cleaned(raw)
        if self._exposure is not None:
            frame = self._exposure(frame)
        # Materials are recognised by their hue, in the colors of the reference frame.
        frame = self._gloss(frame)
        return self._daylight.on(self._lights(frame))

    def frames(self, raws: Iterable[RawFrame]) -> Iterator[Frame]:
        """Prepare frames lazily, one by one."""
        for raw in raws:
            frame = self(raw)
            del raw  # neither may stay alive while the next one is made
            yield frame
            del frame

    def _cleaned(self, raw: RawFrame) -> Frame:
        """Return a frame after denoising, openings and filling.

        Depth equal to the previous frame's is not filled again. A static scene may have a single
        depth picture, depth may have half the rate of color, or replace an unreadable one.
        """
        color = sanitize_color(raw.color)
        if self._last is None or not self._stays(raw, color, *self._last):
            self._last = raw.depth, raw.normal, self._clean(raw.depth, color)
        _, normal, clean = self._last
        frame = Frame(*(color, clean.depth, clean.opening, normal), index=raw.index, pose=raw.pose)
        return self._measures(frame)

    def _stays(
        self,
        raw: RawFrame,
        color: Picture,
        depth: Picture,
        normal: Picture | None,
        clean: CleanDepth,
    ) -> bool:
        """Return whether a frame has the depth, normals and openings of the previous one."""
        if not (_same(raw.depth, depth) and _same(raw.normal, normal)):
            return False
        return np.array_equal(self._filling.holes.openings(raw.depth, color), clean.opening)

    def _clean(self, depth: Picture, color: Picture) -> CleanDepth:
        def clean() -> CleanDepth:
            return sanitize_depth(smoothed(depth, self._noise), color, self._filling)

        if self._last is not None or depth.size < WORTH_KEEPING:
            return clean()
        return kept_depth(depth, color, clean, self._measures)


def kept_depth(
    depth: Picture, color: Picture, clean: Callable[[], CleanDepth], measures: Measures
) -> CleanDepth:
    """Return the result of `clean`, which is kept with its measures (`iprt.device.kept`)."""

    def make() -> Arrays:
        result = clean()
        changed = result.depth.view(np.uint32) != depth.view(np.uint32)
        planes = {"changed": np.packbits(changed), "opening": np.packbits(result.opening)}
        measured = np.array([measures.of(result.depth)[name] for name in OF_DEPTH])
        return planes | {"depth": result.depth[changed], "measures": measured}

    holes = np.pad(~usable(depth).all(axis=1), 1)
    # Only the colors of holes and of the rims around them matter.
    beside = color[holes[:-2] | holes[1:-1] | holes[2:]]
    found = kept("depth", __name__, [depth, beside], make)
    cleaned = _cleaned(depth, found)
    measures.know(cleaned.depth, dict(zip(OF_DEPTH, found["measures"].tolist(), strict=True)))
    return cleaned


def _cleaned(depth: Picture, found: Arrays) -> CleanDepth:
    """Return clean depth from the result that `kept_depth` keeps."""
    changed, opening = (
        np.unpackbits(found[name], count=depth.size).reshape(depth.shape).view(bool)
        for name in ("changed", "opening")
    )
    if not found["depth"].size:
        return CleanDepth(depth, opening)
    cleaned = depth.copy()
    cleaned[changed] = found["depth"]
    return CleanDepth(cleaned, opening)


def _same(plane: Picture | None, other: Picture | None) -> bool:
    """Return whether planes are equal, bit for bit."""
    if plane is None or other is None:
        return plane is other
    return plane is other or np.array_equal(plane.view(np.uint32), other.view(np.uint32))
