"""Writing of all edits to `scene.toml`.

Comments, order and everything else in the file stay unchanged.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray

from iprt.errors import SceneError
from iprt.files.safe_reading import require_inside
from iprt.geometry.camera import View
from iprt.geometry.material import Material, MaterialKind
from iprt.geometry.mesh_files import MeshFile
from iprt.scene.light_edits import UNEDITED, LightEdit, write_light
from iprt.scene.light_tables import written_light
from iprt.scene.manifest import MANIFEST_NAME, manifest_text, parse_manifest
from iprt.scene.manifest_writing import (
    changing,
    extended,
    inline,
    matrix_array,
    mesh_copies,
    object_text,
    outdate_truths,
    show_object,
    table_text,
    write_manifest,
)
from iprt.scene.material_maps import MAPS, MapName, map_suffix, write_map
from iprt.scene.object_edits import ObjectEdit, renamed
from iprt.scene.scene import Scene
from iprt.scene.view_edits import ViewEdit
from iprt.scene.view_writing import keyframe_array, new_view_texts, write_keyframes, write_views

SAVED_VIEW = "saved"
"""Name of the view that saving keeps: the user's view, with all shown objects."""
COLORS: Mapping[MaterialKind, str] = {"conductor": "reflectance", "dielectric": "transmittance"}
"""Keys of colors other than `albedo`, in scene.toml."""
MAPS_LOST = "clear coat, sheen, specular reflection or transmission"
"""Maps that the table of a material does not have."""
LOG = logging.getLogger("iprt.scene")


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
    views: Sequence[ViewEdit] = (),
    base: str | None = None,
    look: Look | None = None,
) -> dict[Path, Path]:
    """Write edits to a scene's `scene.toml`, and copy the files of new objects.

    New objects are added to views that list their objects, unless the view has a truth. If a view
    with a truth omits them, `look` is kept as the view `SAVED_VIEW`, which shows them. Views whose
    truth shows edited objects are marked with `truth_outdated`.

    Parameters
    ----------
    light : LightEdit
        Edits of light and reflections.
    views : sequence of ViewEdit
    base : str or None
        Text that the edits apply to; None for the file's current text.

    Returns
    -------
    dict of Path to Path
        Mesh files of the new objects, in the scene's folder, by their source.

    Raises
    ------
    SceneError, FormatError
        The edits cannot be saved; nothing has been written.
    """
    with changing(scene.root):
        return _save(scene, edits, light, views, base, look)


def _save(
    scene: Scene,
    edits: Iterable[ObjectEdit],
    light: LightEdit,
    views: Sequence[ViewEdit],
    base: str | None,
    look: Look | None,
) -> dict[Path, Path]:
    path = scene.root / MANIFEST_NAME
    before = manifest_text(path)
    parse_manifest(before, str(path))  # it may have changed since it was read
    new = NewFiles(scene, scene.root)
    text = edited_text(new, edits, light, before if base is None else base, look, views)
    with new.sources() as copies:
        write_manifest(scene.root, text, f"{path}: the edits do not fit into it", copies)
    return {source: scene.root / target for source, target in new.targets.items()}


def edited_text(
    new: NewFiles,
    edits: Iterable[ObjectEdit],
    light: LightEdit,
    base: str,
    look: Look | None = None,
    views: Sequence[ViewEdit] = (),
) -> str:
    """Return the text of `scene.toml` with edits, as `save_edits` writes it.

    Parameters
    ----------
    new : NewFiles
        Takes the files that the text names besides the scene's.
    light, base, look, views
        See `save_edits`.

    Raises
    ------
    SceneError, FormatError
        The edits cannot be saved.
    """
    objects = [table.name for table in parse_manifest(base, MANIFEST_NAME).objects]
    if texts := new_view_texts(views, objects):
        base = extended(base, texts)
    document = tomlkit.parse(base)
    write_views(document, views)
    write_light(document, light)
    edits = _rename(document, tuple(edits))
    edits = [edit for edit in edits if edit != ObjectEdit(edit.name)]
    tables = {str(table["name"]): table for table in document.get("objects", ())}
    originals = {name: table.unwrap() for name, table in tables.items()}
    outdate_truths(document, [e.name for e in edits if e.name in tables or not e.removed])
    added: dict[str, str] = {}  # texts of new objects
    for edit in edits:
        if edit.removed:
            _remove(document, edit.name)
        elif edit.name in tables:
            tables[edit.name].update(_changed_keys(edit, new, tables[edit.name]))
            if edit.keyframes is not None:
                write_keyframes(tables[edit.name], edit.keyframes)
        elif (values := _new_values(edit, originals, new)) is not None:
            values |= _changed_keys(edit, new, values)
            if edit.keyframes is not None:
                values["keyframes"] = keyframe_array(edit.keyframes) if edit.keyframes else None
            added[edit.name] = object_text(**values)
    shown = [show_object(document, name) for name in added]
    texts = list(added.values())
    if look is not None and look.view.projection == "perspective":
        texts += _keep(document, look, needed=not all(shown))
    new.require_inside()
    return extended(tomlkit.dumps(document), texts) if texts else tomlkit.dumps(document)


class NewFiles:
    """Files of edits that a scene does not have yet: meshes, which objects may share, and maps.

    Parameters
    ----------
    scene : Scene
    home : Path
        The folder in the scene's that gets them.

    Attributes
    ----------
    targets : dict of Path to str
        Paths of the meshes in the scene's folder, by their source.
    """

    def __init__(self, scene: Scene, home: Path) -> None:
        self._scene, self._home = scene, home
        self._copies: dict[Path, Path] = {}
        self._maps: dict[Path, tuple[MapName, NDArray[np.float32]]] = {}
        self.targets: dict[Path, str] = {}

    def mesh(self, source: Path, name: str) -> str:
        """Return the path in the scene's folder of the mesh of an object with this name."""
        if source not in self.targets:
            file = MeshFile(source, None)
            files, target = mesh_copies(self._scene.root, file, name, self._copies, self._home)
            self._copies |= files
            self.targets[source] = target
        return self.targets[source]

    def map(self, name: str, key: MapName, image: NDArray[np.float32]) -> str:
        """Return the path in the scene's folder of a map of an object with this name.

        A new file is named by its contents.
        """
        scene = self._scene
        for table, entry in zip(scene.manifest.objects, scene.objects, strict=True):
            maps = {} if table.material is None else table.material.maps
            known = getattr(entry.bound.materials[0], key) if key in maps else None
            if known is not None and np.array_equal(known, image):
                return maps[key]
        digest = hashlib.blake2b(image.tobytes(), digest_size=4).hexdigest()
        file = self._home / "textures" / f"{name}-{key}-{digest}{map_suffix(image, key)}"
        self._maps[file] = key, image
        return file.relative_to(scene.root).as_posix()

    def require_inside(self) -> None:
        """Raise FormatError if a link leads out of the scene's folder."""
        for target in (*self._copies, *self._maps):
            require_inside(target, self._scene.within)

    @contextmanager
    def sources(self) -> Iterator[dict[Path, Path]]:
        """Yield the files (target -> source); maps are temporary ones."""
        with TemporaryDirectory() as folder:
            copies = dict(self._copies)
            for target, (key, image) in self._maps.items():
                copies[target] = Path(folder) / target.name
                write_map(copies[target], image, key)
            yield copies


def _rename(document: Any, edits: Sequence[ObjectEdit]) -> list[ObjectEdit]:
    """Rename objects in a document; return the edits that remain to be written."""
    known = {str(table["name"]): table for table in document.get("objects", ())}
    names = {old: edit.name for old, edit in renamed(edits).items() if old in known}
    for old, new in names.items():
        known[old]["name"] = new
        for view in document.get("views", ()):
            shown = view.get("objects", [])
            for number, name in enumerate(shown):
                if name == old:
                    shown[number] = new
    kept = [edit for edit in edits if edit.name not in names]
    return [replace(e, copy_of=None) if names.get(e.copy_of or "") == e.name else e for e in kept]


def _new_values(
    edit: ObjectEdit, originals: Mapping[str, Mapping[str, Any]], new: NewFiles
) -> dict[str, Any] | None:
    """Return the table of a new object without its other edits; None if there is no such object.

    Raises
    ------
    SceneError
        It is a copy of an object that the file does not have.
    """
    if edit.copy_of is not None:
        if edit.copy_of not in originals:
            raise SceneError(
                f"{edit.name}: is a copy of {edit.copy_of}, which {MANIFEST_NAME} does not have; "
                f"remove {edit.name}, or put {edit.copy_of} back"
            )
        values = {**originals[edit.copy_of], "name": edit.name}
        values["to_world"] = np.reshape(np.array(values["to_world"], np.float64), (4, 4))
        return values
    if edit.to_world is None:
        return None
    if edit.path is not None:
        return {"name": edit.name, "mesh": new.mesh(edit.path, edit.name)}
    return None if edit.light is None else {"name": edit.name}


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


def _changed_keys(edit: ObjectEdit, new: NewFiles, table: Any) -> dict[str, Any]:
    """Return the edited keys of an object, and remove its cleared keys from the table."""
    changed: dict[str, Any] = {}
    if edit.light is not None:
        changed["light"] = inline(written_light(edit.light))
    if edit.to_world is not None:
        changed["to_world"] = matrix_array(np.reshape(edit.to_world, (4, 4)))
    if edit.material is not None:
        changed["material"] = inline(_material_table(edit, new))
    for key, value in (("group", edit.group), ("locked", edit.locked)):
        if value:
            changed[key] = value
        elif value is not None:
            table.pop(key, None)
    return changed


def _material_table(edit: ObjectEdit, new: NewFiles) -> dict[str, Any]:
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
            written[key] = new.map(edit.name, key, image)
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
