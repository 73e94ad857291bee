"""Light from outside a scene that no camera saw, found and cached."""

from __future__ import annotations

import logging

import numpy as np

from iprt.device.kept import Arrays, kept
from iprt.errors import FormatError
from iprt.footage.found_light import SunChoice
from iprt.footage.found_sun.patches import SunPatches
from iprt.footage.prepare.reading import RawFrames
from iprt.footage.prepare.stages import Preparation
from iprt.footage.real_material import RealMaterial
from iprt.footage.sky import Sky
from iprt.footage.sun import Sun
from iprt.scene.manifest import Manifest
from iprt.scene.real_materials import MIN_HEIGHT, file_states

LOG = logging.getLogger("iprt.scene")


def found_light(
    frames: RawFrames,
    manifest: Manifest,
    materials: tuple[RealMaterial, ...],
    choice: SunChoice,
) -> tuple[Sun | None, Sky | None]:
    """Return the sun and the sky that `find_light` finds in the first frame of a scene.

    The result is kept as `found_materials` keeps its own. An unreadable frame is no error, but
    reported where it is needed.
    """
    known, source = None if choice == "auto" else choice, frames.source
    sky = manifest.video.sky == "auto"
    if source.size[1] < MIN_HEIGHT or not (sky or choice == "auto"):
        return known, None
    video = manifest.video.model_dump_json(exclude={"gloss", "sun"})

    def find() -> Arrays:
        from iprt.footage.found_light import find_light

        raw = frames.read(source.indices[0])
        LOG.info("looking for sunlight and for the sky behind windows, once for this footage")
        frame = Preparation(source.white, materials)(raw)
        sun, above = find_light(frame, choice, sky=sky)
        return {
            "sun": np.zeros(0) if sun is None else _values(sun),
            "gain": np.zeros((0, 3)) if above is None else above.gain,
        }

    try:
        inputs = [video, materials, choice, file_states(source)]
        found = kept("light", __name__, inputs, find)
    except FormatError:
        return known, None
    above = Sky(found["gain"], np.eye(3)) if len(found["gain"]) else None
    if choice != "auto" or not len(found["sun"]):
        return known, above
    red, green, blue = found["sun"][3:6].tolist()
    correlation = float(found["sun"][6])
    return Sun(found["sun"][:3], (red, green, blue), correlation=correlation), above


def _values(sun: Sun) -> np.ndarray:
    return np.array([*sun.direction, *sun.irradiance, sun.correlation or 0.0], np.float64)


def sun_patches(
    frames: RawFrames, manifest: Manifest, materials: tuple[RealMaterial, ...], sun: Sun
) -> SunPatches | None:
    """Return the patches by which a sun's brightness is followed, kept as `found_light` keeps it.

    None where there is one frame, too few patches, or a moving camera, to which they would move.
    """
    source = frames.source
    if len(source.indices) == 1 or source.pose(source.indices[0]) is not None:
        return None
    video = manifest.video.model_dump_json(exclude={"gloss", "sun", "sky"})
    inputs = [video, materials, sun.direction, file_states(source)]

    def find() -> Arrays:
        frame = Preparation(source.white, materials)(frames.read(source.indices[0]))
        patches = SunPatches.of(frame, sun.direction)
        if patches is None:
            return {}
        return {name: np.asarray(value) for name, value in vars(patches).items()}

    try:
        found = kept("patches", __name__, inputs, find)
    except FormatError:
        return None
    if not found:
        return None
    return SunPatches(int(found["rows"]), found["lit"], found["shaded"], found["contrast"])
