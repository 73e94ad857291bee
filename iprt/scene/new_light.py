"""Addition of a light without geometry to a scene: extends `scene.toml`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray

from iprt.files.safe_reading import require_inside
from iprt.geometry.ies import Luminaire, read_ies
from iprt.geometry.mesh import Instance, light_mesh
from iprt.scene.light_tables import checked_light
from iprt.scene.manifest import MANIFEST_NAME, manifest_text
from iprt.scene.manifest_writing import (
    changing,
    extended,
    object_text,
    outdate_truths,
    show_object,
    write_manifest,
)
from iprt.scene.new_object import object_name
from iprt.scene.placement import RealSurfaces, direction_of
from iprt.scene.scene import Scene

SUN_DISTANCE = 0.8
"""Distance of a sun's place, as a share of the median depth."""


@dataclass(frozen=True)
class AddedLight:
    """The result of `add_light`.

    Attributes
    ----------
    name : str
    position : (3,) float64
        In the world, in metres.
    warnings : tuple of str
        Faults of its placement.
    """

    name: str
    position: NDArray[np.float64]
    warnings: tuple[str, ...]


def add_light(
    scene_path: Path,
    values: dict[str, Any],
    yaw_deg: float,
    pitch_deg: float,
    *,
    above_m: float,
    turn_deg: float = 0.0,
    profile: Path | None = None,
    name: str | None = None,
    allow_outside: bool = False,
) -> AddedLight:
    """Place a light above the surface seen in a direction, shining down.

    A sun shines from that direction instead. Views that list their objects show the light too,
    unless they have a truth.

    Parameters
    ----------
    values : dict
        `light` as in the manifest, without a profile.
    yaw_deg, pitch_deg : float
        Direction from the capture centre: to the right and up.
    above_m : float
        Height above the surface, in metres.
    turn_deg : float
        Rotation about the vertical, counter-clockwise seen from above.
    profile : Path or None
        Photometric file, which is copied into the scene.
    name : str or None
        By default the kind of the light, with a number if taken.

    Raises
    ------
    SceneError, FormatError
        The light cannot be added; nothing has been written.
    """
    with changing(scene_path.parent if scene_path.name == MANIFEST_NAME else scene_path):
        scene = Scene.open(scene_path, allow_outside=allow_outside)
        chosen = object_name(scene, values["kind"], name)
        luminaire: Luminaire | None = None
        copies: dict[Path, Path] = {}
        if profile is not None:
            luminaire = read_ies(profile)
            copies, kept = _profile_copy(scene, profile)
            values = values | {"profile": kept}
        table = checked_light(values)
        frame = scene.frame()
        surfaces = RealSurfaces(frame)
        if table.kind == "sun":
            towards = direction_of(yaw_deg, pitch_deg)
            to_world = _shining(towards, SUN_DISTANCE * frame.median_depth * towards)
        else:
            to_world = hanging(surfaces.hit(yaw_deg, pitch_deg)[0], above_m, turn_deg)
        mesh = light_mesh(table.light(scene.manifest.nits, luminaire))
        document = tomlkit.parse(manifest_text(scene.root / MANIFEST_NAME))
        outdate_truths(document, [chosen])
        show_object(document, chosen)
        added = object_text(name=chosen, light=values, to_world=to_world)
        text = extended(tomlkit.dumps(document), [added])
        write_manifest(scene.root, text, f"{chosen} cannot be added", copies)
    faults = surfaces.placement_faults(Instance(chosen, mesh, to_world))
    return AddedLight(chosen, to_world[:3, 3], tuple(faults))


def _profile_copy(scene: Scene, profile: Path) -> tuple[dict[Path, Path], str]:
    """Return the file to copy (target -> source), if any, and its path in the manifest."""
    root, source = scene.root.resolve(), profile.resolve()
    if source.is_relative_to(root):
        return {}, source.relative_to(root).as_posix()
    target = f"profiles/{profile.name}"
    require_inside(scene.root / target, scene.within)
    return {scene.root / target: profile}, target


def hanging(
    point: NDArray[np.float64], above_m: float, turn_deg: float = 0.0
) -> NDArray[np.float64]:
    """Return the (4, 4) transform of a light above a point that shines down."""
    sine, cosine = np.sin(np.deg2rad(turn_deg)), np.cos(np.deg2rad(turn_deg))
    matrix = np.eye(4)
    matrix[:3, :3] = np.transpose([[cosine, 0.0, -sine], [-sine, 0.0, -cosine], [0.0, 1.0, 0.0]])
    matrix[:3, 3] = point + np.array([0.0, above_m, 0.0])
    return matrix + 0.0  # without negative zeros


def _shining(towards: NDArray[np.float64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (4, 4) transform of a light that shines from a direction."""
    across = np.cross((0.0, 1.0, 0.0), towards)
    if not np.linalg.norm(across) > 1e-6:
        across = np.array([1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    matrix = np.eye(4)
    matrix[:3, :3] = np.transpose([across, np.cross(towards, across), towards])
    matrix[:3, 3] = place
    return matrix + 0.0
