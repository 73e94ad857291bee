"""Edits of a scene's objects, and writing all edits to `scene.toml`.

Comments, order and everything else in the file stay unchanged.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray

from iprt.errors import SceneError
from iprt.files.safe_reading import require_inside
from iprt.geometry.camera import View
from iprt.geometry.keyframes import ObjectMotion
from iprt.geometry.material import Material, MaterialKind
from iprt.geometry.mesh_files import MeshFile
from iprt.scene.light_edits import UNEDITED, LightEdit, write_light
from iprt.scene.light_tables import LightTable, written_light
from iprt.scene.manifest import (
    MANIFEST_NAME,
    allowed_transform,
    manifest_text,
    parse_manifest,
)
from iprt.scene.manifest_writing import (
    changing,
    extended,
    inline,
    light_text,
    matrix_array,
    mesh_copies,
    object_text,
    outdate_truths,
    show_object,
    table_text,
    write_manifest,
)
from iprt.scene.material_maps import MAPS, MapName, map_suffix, write_map
from iprt.scene.objects import AnyMesh, SceneLight, SceneObject, painted
from iprt.scene.scene import Scene

SAVED_VIEW = "saved"
"""Name of the view that saving keeps: the user's view, with all shown objects."""
COLORS: Mapping[MaterialKind, str] = {"conductor": "reflectance", "dielectric": "transmittance"}
"""Keys of colors other than `albedo`, in scene.toml."""
NewMaps = dict[Path, tuple[MapName, NDArray[np.float32]]]
"""Maps to be written, by file."""
MAPS_LOST = "clear coat, sheen, specular reflection or transmission"
"""Maps that the table of a material does not have."""
LOG = logging.getLogger("iprt.scene")
Matrix = tuple[float, ...]
"""The 16 values of a (4, 4) transform, row-major."""


@dataclass(frozen=True)
class ObjectEdit:
    """An object's differences from the scene's files.

    Attributes
    ----------
    to_world : tuple of 16 float or None
        Replaces the object's own; keyframes are relative to it.
    material : Material or None
        Replaces the object's own materials.
    mesh : Mesh or AnimatedMesh or None
        The mesh of an object that the files do not have.
    path : Path or None
        Source file of `mesh`.
    removed : bool
        The object is removed.
    light : LightTable or None
        Replaces the object's own, or makes a new light without geometry.
    maps : tuple of int
        Identities of the maps and variants of `material`, which comparisons of materials ignore.
    """

    name: str
    to_world: Matrix | None = None
    material: Material | None = None
    mesh: AnyMesh | None = field(default=None, compare=False)
    path: Path | None = None
    removed: bool = False
    light: LightTable | None = field(default=None, hash=False)  # has lists
    maps: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        keys = () if self.material is None else (*MAPS, "variants")
        maps = tuple(id(getattr(self.material, key)) for key in keys)
        object.__setattr__(self, "maps", maps)


def flat(to_world: NDArray[np.float64]) -> Matrix:
    """Return a (4, 4) transform as a row-major tuple."""
    return tuple(float(value) for value in np.reshape(to_world, 16))


def require_place(name: str, to_world: NDArray[np.float64]) -> None:
    """Check that `scene.toml` may hold a (4, 4) transform.

    Raises
    ------
    SceneError
        It may not.
    """
    try:
        allowed_transform(list(flat(to_world)))
    except ValueError as problem:
        raise SceneError(f"{name} cannot be put there: {problem}") from None


def edited_objects(
    objects: Sequence[SceneObject], edits: Iterable[ObjectEdit], nits: float
) -> tuple[SceneObject, ...]:
    """Return the objects with all edits applied; objects new to the scene come last.

    `nits` are the scene's.
    """
    by_name = {edit.name: edit for edit in edits}
    known = {entry.name for entry in objects}
    found = [_edited(entry, by_name.get(entry.name)) for entry in objects]
    for edit in by_name.values():
        if edit.name not in known and edit.mesh is not None:
            entry = SceneObject(edit.name, edit.mesh, ObjectMotion(np.eye(4)))
            found.append(_edited(entry, edit))
        elif edit.name not in known and edit.light is not None:
            light = SceneLight(edit.light, nits)
            entry = SceneObject(edit.name, light.mesh(), ObjectMotion(np.eye(4)), light)
            found.append(_edited(entry, edit))
    return tuple(entry for entry in found if entry is not None)


def _edited(entry: SceneObject, edit: ObjectEdit | None) -> SceneObject | None:
    if edit is None:
        return entry
    if edit.removed:
        return None
    if edit.to_world is not None:
        to_world = np.reshape(np.array(edit.to_world, np.float64), (4, 4))
        entry = replace(entry, motion=replace(entry.motion, to_world=to_world))
    if edit.light is not None and entry.light is not None:
        light = replace(entry.light, table=edit.light)
        entry = replace(entry, light=light, mesh=light.mesh())
    if edit.material is not None:
        entry = replace(entry, mesh=painted(entry.mesh, edit.material))
    return entry


@dataclass(frozen=True)
class Look:
    """The user's view when the edits are saved.

    Attributes
    ----------
    objects : tuple of str or None
        Names of the shown objects; None for all.
    """

    view: View
    objects: tuple[str, ...] | None = None


def save_edits(
    scene: Scene,
    edits: Iterable[ObjectEdit],
    *,
    light: LightEdit = UNEDITED,
    base: str | None = None,
    look: Look | None = None,
) -> dict[str, Path]:
    """Write edits to a scene's `scene.toml`, and copy the files of new objects.

    New objects are added to views that list their objects, unless the view has a truth. If a view
    with a truth omits them, `look` is kept as the view `SAVED_VIEW`, which shows them. Views whose
    truth shows edited objects are marked with `truth_outdated`.

    Parameters
    ----------
    light : LightEdit
        Edits of light and reflections.
    base : str or None
        Text that the edits apply to; None for the file's current text.

    Returns
    -------
    dict of str to Path
        Mesh files of the new objects, in the scene's folder, by the object's name.

    Raises
    ------
    SceneError, FormatError
        The edits cannot be saved; nothing has been written.
    """
    with changing(scene.root):
        return _save(scene, edits, light, base, look)


def _save(
    scene: Scene,
    edits: Iterable[ObjectEdit],
    light: LightEdit,
    base: str | None,
    look: Look | None,
) -> dict[str, Path]:
    path = scene.root / MANIFEST_NAME
    before = manifest_text(path)
    parse_manifest(before, str(path))  # it may have changed since it was read
    document = tomlkit.parse(before if base is None else base)
    write_light(document, light)
    tables = {str(table["name"]): table for table in document.get("objects", ())}
    maps: NewMaps = {}
    edits = [edit for edit in edits if edit != ObjectEdit(edit.name)]
    outdate_truths(document, [e.name for e in edits if e.name in tables or not e.removed])
    copies: dict[Path, Path] = {}
    added: dict[str, Path] = {}
    texts: list[str] = []
    new: list[str] = []
    for edit in edits:
        table = tables.get(edit.name)
        if edit.removed:
            _remove(document, edit.name)
        elif table is not None:
            _edit_table(table, edit, scene, maps)
        elif edit.path is not None and edit.to_world is not None:
            files, target = mesh_copies(scene.root, MeshFile(edit.path, None), edit.name, copies)
            copies |= files
            material = None if edit.material is None else _material_table(edit, scene, maps)
            to_world = np.reshape(np.array(edit.to_world), (4, 4))
            texts.append(object_text(edit.name, target, to_world, material))
            added[edit.name] = scene.root / target
            new.append(edit.name)
        elif edit.light is not None and edit.to_world is not None:
            to_world = np.reshape(np.array(edit.to_world), (4, 4))
            texts.append(light_text(edit.name, written_light(edit.light), to_world))
            new.append(edit.name)
    shown = [show_object(document, name) for name in new]
    if look is not None and look.view.projection == "perspective":
        texts += _keep(document, look, needed=not all(shown))
    for copy in (*copies, *maps):
        require_inside(copy, scene.within)
    text = extended(tomlkit.dumps(document), texts) if texts else tomlkit.dumps(document)
    with TemporaryDirectory() as folder:
        for file, (key, image) in maps.items():
            copies[file] = Path(folder) / file.name
            write_map(copies[file], image, key)
        write_manifest(scene.root, text, f"{path}: the edits do not fit into it", copies)
    return added


def _remove(document: Any, name: str) -> None:
    """Remove an object, and its name from the views that show it."""
    objects = document.get("objects", ())
    for number in reversed(range(len(objects))):
        if objects[number]["name"] == name:
            del objects[number]
    if "objects" in document and not objects:
        del document["objects"]  # `objects = []` would forbid tables for new objects
    for view in document.get("views", ()):
        if name in view.get("objects", ()):
            view["objects"].remove(name)


def _keep(document: Any, look: Look, *, needed: bool) -> list[str]:
    """Set the view `SAVED_VIEW` to a look; return its text if it is `needed` and missing."""
    view = look.view
    values = {
        "yaw_deg": round(view.yaw_deg, 3),
        "pitch_deg": round(view.pitch_deg, 3),
        "fov_y_deg": round(view.fov_y_deg, 3),
        "size": [view.width, view.height],
    }
    if look.objects is not None:
        values["objects"] = list(look.objects)
    for table in document.get("views", ()):
        if table["name"] == SAVED_VIEW:
            if "truth" not in table and "keyframes" not in table:
                table.pop("objects", None)
                table.update(values)
            return []
    if not needed:
        return []
    return [table_text("views", name=SAVED_VIEW, **values)]


def _edit_table(table: Any, edit: ObjectEdit, scene: Scene, maps: NewMaps) -> None:
    if edit.to_world is not None:
        table["to_world"] = matrix_array(np.reshape(edit.to_world, (4, 4)))
    if edit.material is not None:
        table["material"] = inline(_material_table(edit, scene, maps))
    if edit.light is not None:
        table["light"] = inline(written_light(edit.light))


def _material_table(edit: ObjectEdit, scene: Scene, new: NewMaps) -> dict[str, Any]:
    """Return the new `material` table; maps that are in no file of the scene go to `new`.

    Of values that vary over the surface, it has the means, with a warning.
    """
    material = edit.material
    assert material is not None
    if any(material.map_places):
        LOG.warning("%s: the saved material has all maps where its color lies", edit.name)
    if material.palette:
        LOG.warning("%s: the saved material has the means of its maps of %s", edit.name, MAPS_LOST)
    color = COLORS.get(material.kind, "albedo")
    written: dict[str, Any] = {"kind": material.kind, color: list(material.albedo)}
    if material.kind != "diffuse":
        written["alpha"] = material.alpha
    if material.kind in ("plastic", "principled", "dielectric"):
        written["ior"] = material.ior
    if material.kind == "principled":
        written["metallic"] = material.metallic
        written |= _cover(material)
    if material.transmits:
        written |= _transmission(material)
    if material.emits:
        written["emission"] = list(material.emission)
    if material.opacity < 1.0:
        written["opacity"] = material.opacity
    if material.cutoff > 0.0:
        written["cutoff"] = material.cutoff
    for key in MAPS:
        image = getattr(material, key)
        if image is not None and _has_use_of(material, key):
            written[key] = _map_file(edit.name, key, image, scene, new)
    return written


def _has_use_of(material: Material, key: MapName) -> bool:
    if key == "clearcoat_normal_texture":
        return material.has_coat
    return key != "surface_texture" or material.kind == "principled"


def _cover(material: Material) -> dict[str, Any]:
    """Return the keys of the layers above a principled material, without keys of no effect."""
    written: dict[str, Any] = {}
    if material.clearcoat > 0.0:
        written |= {"clearcoat": material.clearcoat, "clearcoat_alpha": material.clearcoat_alpha}
    if max(material.sheen) > 0.0:
        written |= {"sheen": list(material.sheen), "sheen_alpha": material.sheen_alpha}
    if min(material.tint) < 1.0:
        written["tint"] = list(material.tint)
    return written


def _transmission(material: Material) -> dict[str, Any]:
    """Return the keys of a material that transmits light, without keys of no effect."""
    written: dict[str, Any] = {}
    if material.kind == "principled":
        written["transmission"] = material.transmission
    if material.thin:
        written["thin"] = True
    if max(material.absorption) > 0.0:
        written["absorption"] = list(material.absorption)
    if material.priority != 0:
        written["priority"] = material.priority
    return written


def _map_file(
    name: str, key: MapName, image: NDArray[np.float32], scene: Scene, new: NewMaps
) -> str:
    """Return the file of a map, as named in the scene; a new one is named by its contents."""
    for table, entry in zip(scene.manifest.objects, scene.objects, strict=True):
        maps = {} if table.material is None else table.material.maps
        known = getattr(entry.bound.materials[0], key) if key in maps else None
        if known is not None and np.array_equal(known, image):
            return maps[key]
    digest = hashlib.blake2b(image.tobytes(), digest_size=4).hexdigest()
    file = f"textures/{name}-{key}-{digest}{map_suffix(image, key)}"
    new[scene.root / file] = key, image
    return file
