"""Light from outside a scene that no camera saw, found and cached."""

from __future__ import annotations

import logging

import numpy as np

from iprt.device.kept import Arrays, kept
from iprt.errors import FormatError
from iprt.footage.found_sun.patches import SunPatches
from iprt.footage.outside_light import OutsideLight, SunChoice
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
) -> OutsideLight:
    """Return the light that `find_light` finds in the first frame of a scene.

    The result is kept as `searched_gloss` keeps its own. An unreadable frame is no error, but
    reported where it is needed.
    """
    known, source = None if choice == "auto" else choice, frames.source
    sky = manifest.video.sky == "auto"
    if source.size[1] < MIN_HEIGHT or not (sky or choice == "auto"):
        return OutsideLight(known)
    video = manifest.video.model_dump_json(exclude={"gloss", "sun"})

    def find() -> Arrays:
        from iprt.footage.found_light import find_light

        raw = frames.read(source.indices[0])
        LOG.info("looking for sunlight and for the sky behind windows, once for this footage")
        light = find_light(Preparation(source.white, materials)(raw), choice, sky=sky)
        sun = [] if light.sun is None else [*light.sun.direction, *light.sun.irradiance]
        return {
            "sun": np.array(sun, np.float64),
            "correlation": np.array(0.0 if light.sun is None else light.sun.correlation or 0.0),
            "gain": np.zeros((0, 3)) if light.sky is None else light.sky.gain,
            "deviation": np.zeros(3) if light.sky is None else light.sky.deviation,
            "doubt": np.frombuffer(light.doubt.encode(), np.uint8),
        }

    try:
        inputs = [video, materials, choice, file_states(source)]
        found = kept("light", __name__, inputs, find)
    except FormatError:
        return OutsideLight(known)
    above = Sky(found["gain"], found["deviation"]) if len(found["gain"]) else None
    if choice == "auto" and len(found["sun"]):
        red, green, blue = found["sun"][3:].tolist()
        correlation = float(found["correlation"])
        known = Sun(found["sun"][:3], (red, green, blue), correlation=correlation)
    return OutsideLight(known, above, found["doubt"].tobytes().decode())


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
