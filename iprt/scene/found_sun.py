"""The sun of a scene that its panorama does not show, found and cached."""

from __future__ import annotations

import logging

import numpy as np

from iprt.device.kept import Arrays, kept
from iprt.errors import FormatError
from iprt.footage.found_sun.patches import SunPatches
from iprt.footage.prepare.reading import RawFrames
from iprt.footage.prepare.stages import Preparation
from iprt.footage.real_material import RealMaterial
from iprt.footage.sun import Sun
from iprt.scene.manifest import Manifest
from iprt.scene.real_materials import MIN_HEIGHT, file_states

LOG = logging.getLogger("iprt.scene")


def found_sun(
    frames: RawFrames, manifest: Manifest, declared: tuple[RealMaterial, ...]
) -> Sun | None:
    """Return the sun that `find_sun` finds in the first frame of a scene.

    The result is kept as `found_materials` keeps its own. An unreadable frame is no error, but
    reported where it is needed.
    """
    video = manifest.video.model_dump_json(exclude={"gloss", "sun"})
    try:
        if frames.source.size[1] < MIN_HEIGHT:
            return None
        inputs = [video, declared, file_states(frames.source)]
        found = kept("sun", __name__, inputs, lambda: _searched(frames, declared))["sun"]
    except FormatError:
        return None
    if not len(found):
        return None
    red, green, blue = found[3:6].tolist()
    return Sun(found[:3], (red, green, blue), correlation=float(found[6]))


def sun_patches(
    frames: RawFrames, manifest: Manifest, declared: tuple[RealMaterial, ...], sun: Sun
) -> SunPatches | None:
    """Return the patches by which a sun's brightness is followed, kept as `found_sun` keeps it.

    None where there is one frame, too few patches, or a moving camera, to which they would move.
    """
    source = frames.source
    if len(source.indices) == 1 or source.pose(source.indices[0]) is not None:
        return None
    video = manifest.video.model_dump_json(exclude={"gloss", "sun"})
    inputs = [video, declared, sun.direction, file_states(source)]

    def find() -> Arrays:
        frame = Preparation(source.white, declared)(frames.read(source.indices[0]))
        patches = SunPatches.of(frame, sun.direction)
        return {} if patches is None else dict(vars(patches))

    try:
        found = kept("patches", __name__, inputs, find)
    except FormatError:
        return None
    return SunPatches(**found) if found else None


def _searched(frames: RawFrames, declared: tuple[RealMaterial, ...]) -> Arrays:
    """Return direction, irradiance and correlation in an array, empty without a sun."""
    from iprt.footage.found_sun.search import find_sun

    source = frames.source
    raw = frames.read(source.indices[0])
    LOG.info("looking for patches of sunlight, once for this footage")
    frame = Preparation(source.white, declared)(raw)
    sun = find_sun(frame)
    if sun is None:
        return {"sun": np.zeros(0)}
    turn = np.eye(3) if frame.pose is None else frame.pose[:3, :3]
    values = [*(turn @ sun.direction), *sun.irradiance, sun.correlation]
    return {"sun": np.array(values, np.float64)}
