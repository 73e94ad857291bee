"""Addition of a mesh to a scene, with a view of it: copies the mesh and extends `scene.toml`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray

from iprt.errors import SceneError
from iprt.files.safe_reading import MAX_OBJECTS, anywhere, require_inside
from iprt.geometry.animated_mesh import load_animated_mesh
from iprt.geometry.gltf_clip import animation_names
from iprt.geometry.material import MAX_EMISSION
from iprt.geometry.mesh import Instance, Mesh
from iprt.geometry.mesh_files import MeshFile
from iprt.geometry.meshes import load_mesh
from iprt.scene.manifest import MANIFEST_NAME, manifest_text
from iprt.scene.manifest_writing import (
    VIEW_SIZE,
    changing,
    extended,
    free_name,
    mesh_copies,
    object_text,
    outdate_truths,
    table_text,
    write_manifest,
)
from iprt.scene.mesh_pose import MeshPose, hints
from iprt.scene.placement import RealSurfaces, bounds, metres, set_down
from iprt.scene.scene import Scene

Corners = tuple[NDArray[np.float64], NDArray[np.float64]]
LAMP_ALBEDO = 0.5
MOST_FIELDS = {"diffuse": 1, "conductor": 2, "plastic": 2, "lamp": 1, "glass": 2, "pane": 2}
"""Numbers of fields after the names of materials: color and roughness."""


@dataclass(frozen=True)
class Added:
    """The result of `add_object`.

    Attributes
    ----------
    name, view : str
        Names of the object, and of the view that frames it.
    base : (3,) float64
        World-space point below the object's middle, at the height of its lowest point.
    size : str
        The object's size in the scene and in its file, and its up axis, in words.
    hints : tuple of str
        Flags that the user may need.
    warnings : tuple of str
        Faults of its placement, as `iprt scene check` reports them.
    dropped : tuple of str
        Unread contents of the mesh file.
    """

    name: str
    view: str
    base: NDArray[np.float64]
    size: str
    hints: tuple[str, ...]
    warnings: tuple[str, ...]
    dropped: tuple[str, ...]


def add_object(
    scene_path: Path,
    mesh_path: Path,
    yaw_deg: float,
    pitch_deg: float,
    *,
    pose: MeshPose | None = None,
    material: dict[str, Any] | None = None,
    animation: str | int | None = None,
    name: str | None = None,
    allow_outside: bool = False,
) -> Added:
    """Place a mesh on the surface seen in a direction, and add a view that frames it.

    Parameters
    ----------
    yaw_deg, pitch_deg : float
        Direction from the capture centre: to the right and up.
    pose : MeshPose or None
        Default: +Y up, and its longest side a fifth of the distance.
    material : dict or None
        As in the manifest; by default the mesh file's own.
    animation : str or int or None
        Name or index of an animation of a glTF file.
    name : str or None
        By default the mesh file's name, with a number if taken.
    allow_outside : bool
        Allow links from the scene's files out of its folder, and from the mesh's files out of its
        own.

    Raises
    ------
    SceneError, FormatError
        The mesh cannot be added; nothing has been written.
    """
    pose = pose or MeshPose()
    with changing(scene_path.parent if scene_path.name == MANIFEST_NAME else scene_path):
        scene = Scene.open(scene_path, allow_outside=allow_outside)
        chosen = object_name(scene, mesh_path.stem, name)
        view_name = free_name(chosen, set(scene.views))
        file = MeshFile(mesh_path, anywhere(mesh_path.parent) if allow_outside else None)
        mesh = _mesh(file, animation, allow_outside=allow_outside)
        surfaces = RealSurfaces(scene.frame())
        placed = set_down(surfaces, mesh, yaw_deg, pitch_deg, pose)
        to_world = placed.to_world
        upright = bounds(mesh, pose.rotation)
        added = Added(
            chosen,
            view_name,
            placed.foot,
            _size(mesh, upright, to_world, pose),
            (
                *hints(file.suffix, bounds(mesh), pose),
                *_animation_hints(file, animation),
            ),
            (
                *placed.warnings(),
                *surfaces.placement_faults(Instance(chosen, mesh, to_world)),
            ),
            mesh.dropped,
        )
        copies, target = mesh_copies(scene.root, file, chosen)
        for copy in copies:
            require_inside(copy, scene.within)
        document = tomlkit.parse(manifest_text(scene.root / MANIFEST_NAME))
        outdate_truths(document, [chosen])
        tables = [
            object_text(
                name=chosen,
                mesh=target,
                to_world=to_world,
                animation=animation,
                material=material,
            ),
            _view_text(view_name, chosen, bounds(mesh), to_world),
        ]
        text = extended(tomlkit.dumps(document), tables)
        write_manifest(scene.root, text, f"{mesh_path}: cannot be added as {chosen}", copies)
    return added


def parse_material(text: str) -> dict[str, Any]:
    """Parse a material into a manifest table.

    The forms are `diffuse:R,G,B`, `conductor:R,G,B[:ALPHA]`, `plastic:R,G,B[:ALPHA]`, `mirror`,
    `glass` and `pane`, which may be followed by `:R,G,B[:ALPHA]`, and `lamp:R,G,B`, the emitted
    radiance.

    Raises
    ------
    SceneError
        The text has another form, or numbers out of range.
    """
    if text == "mirror":
        return {"kind": "conductor", "reflectance": [0.95, 0.95, 0.95], "alpha": 0.0}
    if text in ("glass", "pane"):
        text += ":1,1,1"
    kind, *fields = text.split(":")
    most = MOST_FIELDS.get(kind, 0)
    brightest = MAX_EMISSION if kind == "lamp" else 1.0
    try:
        color = [float(value) for value in fields[0].split(",")]
        alpha = [float(value) for value in fields[1:]]
        if not (len(color) == 3 and 1 <= len(fields) <= most):
            raise ValueError
        if not all(0.0 <= value <= brightest for value in [*color, *alpha]):
            raise ValueError
    except (ValueError, IndexError):
        raise SceneError(
            f"--material {text}: expected diffuse:R,G,B or conductor:R,G,B:ALPHA or "
            "plastic:R,G,B:ALPHA or glass:R,G,B:ALPHA or pane:R,G,B:ALPHA with numbers from 0 to "
            "1, lamp:R,G,B with the radiance that it emits, or mirror, glass or pane alone"
        ) from None
    if kind == "lamp":
        return {"kind": "diffuse", "albedo": [LAMP_ALBEDO] * 3, "emission": color}
    rough = {"alpha": alpha[0]} if alpha else {}
    if kind in ("glass", "pane"):
        thin = {"thin": True} if kind == "pane" else {}
        return {"kind": "dielectric", "transmittance": color} | rough | thin
    key = "reflectance" if kind == "conductor" else "albedo"
    return {"kind": kind, key: color} | rough


def object_name(scene: Scene, wanted: str, name: str | None) -> str:
    """Return a free and valid name for an object: `name`, or by default like `wanted`.

    Raises
    ------
    SceneError
        The name is taken or not valid, or the scene is full.
    """
    if len(scene.manifest.objects) >= MAX_OBJECTS:
        raise SceneError(
            f"{scene.root}: has {MAX_OBJECTS} objects, and no more are read; join some of their "
            "meshes"
        )
    taken = {table.name for table in scene.manifest.objects}
    if name is None:
        return free_name(wanted, taken)
    if name in taken:
        raise SceneError(f"{scene.root}: an object is named '{name}' already; choose another name")
    if name != free_name(name, set()):
        raise SceneError(f"--name '{name}': expected letters, digits, blanks, and any of _ . -")
    return name


def _mesh(file: MeshFile, animation: str | int | None, *, allow_outside: bool) -> Mesh:
    """Load the mesh at time 0."""
    within = anywhere(file.path.parent) if allow_outside else None
    if animation is None:
        return load_mesh(file.path, within=within)
    return load_animated_mesh(file.path, animation, within=within).at(0.0)


def _size(mesh: Mesh, upright: Corners, to_world: NDArray[np.float64], pose: MeshPose) -> str:
    scale = float(np.linalg.norm(to_world[:3, 0]))
    low, high = bounds(mesh)
    sides = " x ".join(f"{side:.4g}" for side in high - low)
    turned = f", turned by {pose.turn_deg:g} degrees" if pose.turn_deg else ""
    sign = pose.up if pose.up.startswith("-") else f"+{pose.up}"
    return (
        f"{metres((upright[1] - upright[0]) * scale)} (width, height, depth); in its file "
        f"{sides} units of {scale:.4g} m, {sign.upper()} up{turned}"
    )


def _animation_hints(file: MeshFile, animation: str | int | None) -> list[str]:
    if file.gltf is None or not file.gltf.animations or animation is not None:
        return []
    names = ", ".join(animation_names(file.gltf))
    return [f"its file has the animations {names}; --animation plays one"]


def _view_text(name: str, object_name: str, corners: Corners, to_world: NDArray[np.float64]) -> str:
    """Return a view towards the object's centre, 2.5 times as high as the object appears."""
    low, high = corners
    center = to_world[:3, :3] @ (0.5 * (low + high)) + to_world[:3, 3]
    distance = max(float(np.linalg.norm(center)), 1e-6)
    radius = 0.5 * float(np.linalg.norm(to_world[:3, :3] @ (high - low)))
    fov = np.clip(2.5 * 2.0 * np.rad2deg(np.arctan2(radius, distance)), 15.0, 100.0)
    yaw = np.rad2deg(np.arctan2(center[0], -center[2]))
    pitch = np.rad2deg(np.arcsin(np.clip(center[1] / distance, -1.0, 1.0)))
    return table_text(
        "views",
        name=name,
        yaw_deg=round(float(yaw), 2),
        pitch_deg=round(float(pitch), 2),
        fov_y_deg=round(float(fov), 2),
        size=VIEW_SIZE,
        objects=[object_name],
    )
