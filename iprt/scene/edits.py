"""Objects of a scene as they were edited, and the edits written to `scene.toml`.

Comments, order and all else that the file says stay as they are.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray

from iprt.errors import SceneError
from iprt.files.atomic import replacing
from iprt.files.path_safety import require_inside
from iprt.geometry.camera import View
from iprt.geometry.keyframes import ObjectMotion
from iprt.geometry.material import Material
from iprt.geometry.mesh_files import MeshFile
from iprt.scene.edit import (
    changing,
    copied,
    inline,
    matrix_array,
    mesh_copies,
    object_text,
    outdate_truths,
    table_text,
)
from iprt.scene.manifest import (
    MANIFEST_NAME,
    DiffuseTable,
    allowed_transform,
    manifest_text,
    parse_manifest,
)
from iprt.scene.objects import AnyMesh, SceneObject, made_of
from iprt.scene.scene import Scene

SAVED_VIEW = "saved"
"""Name of the view that saving keeps: where the user looked, with all objects that were shown."""
Matrix = tuple[float, ...]
"""The 16 values of a (4, 4) transform, row by row."""


@dataclass(frozen=True)
class ObjectEdit:
    """An object's differences from the scene's files.

    Attributes
    ----------
    to_world : tuple of 16 float or None
        In place of its own; keyframes move it from there.
    material : Material or None
        In place of its own ones.
    mesh : Mesh or AnimatedMesh or None
        The mesh, if the files do not have the object.
    path : Path or None
        Where that was read from.
    removed : bool
        It is not shown.
    textured : bool
        Whether `material` has a texture, which comparing materials does not show.
    """

    name: str
    to_world: Matrix | None = None
    material: Material | None = None
    mesh: AnyMesh | None = field(default=None, compare=False)
    path: Path | None = None
    removed: bool = False
    textured: bool = field(init=False)

    def __post_init__(self) -> None:
        textured = self.material is not None and self.material.texture is not None
        object.__setattr__(self, "textured", textured)


def flat(to_world: NDArray[np.float64]) -> Matrix:
    """A (4, 4) transform as edits have it."""
    return tuple(float(value) for value in np.reshape(to_world, 16))


def require_place(name: str, to_world: NDArray[np.float64]) -> None:
    """Check that an object can be put there; (4, 4).

    Raises
    ------
    SceneError
        `scene.toml` would not take it.
    """
    try:
        allowed_transform(list(flat(to_world)))
    except ValueError as problem:
        raise SceneError(f"{name} cannot be put there: {problem}") from None


def edited_objects(
    objects: Sequence[SceneObject], edits: Iterable[ObjectEdit]
) -> tuple[SceneObject, ...]:
    """The objects with all edits; those that the scene does not have come last."""
    by_name = {edit.name: edit for edit in edits}
    known = {entry.name for entry in objects}
    found = [_edited(entry, by_name.get(entry.name)) for entry in objects]
    for edit in by_name.values():
        if edit.name not in known and edit.mesh is not None:
            entry = SceneObject(edit.name, edit.mesh, ObjectMotion(np.eye(4)))
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
    if edit.material is not None:
        entry = replace(entry, mesh=made_of(entry.mesh, edit.material))
    return entry


@dataclass(frozen=True)
class Look:
    """The user's view when the edits are saved.

    Attributes
    ----------
    objects : tuple of str or None
        Names of those that are shown. None: all.
    """

    view: View
    objects: tuple[str, ...] | None = None


def save_edits(
    scene: Scene,
    edits: Iterable[ObjectEdit],
    *,
    base: str | None = None,
    look: Look | None = None,
) -> dict[str, Path]:
    """Write edits to a scene's `scene.toml`; files of objects that it did not have are copied.

    A view that lists its objects shows new ones, too, unless it has a truth: that does not. Where
    there is such a view, `look` is kept as the view `SAVED_VIEW`, which shows them. Views whose
    truth shows edited objects are marked with `truth_outdated`.

    Parameters
    ----------
    base : str or None
        The text that the edits are made to. None: what the file says now.

    Returns
    -------
    dict of str to Path
        Mesh files of the new objects, in the scene's folder, by the object's name.

    Raises
    ------
    SceneError, FormatError
        Nothing has been written then.
    """
    with changing(scene.root):
        return _save(scene, edits, base, look)


def _save(
    scene: Scene, edits: Iterable[ObjectEdit], base: str | None, look: Look | None
) -> dict[str, Path]:
    path = scene.root / MANIFEST_NAME
    before = manifest_text(path)
    parse_manifest(before, str(path))  # somebody may have edited it since it was read
    document = tomlkit.parse(before if base is None else base)
    tables = {str(table["name"]): table for table in document.get("objects", ())}
    edits = [edit for edit in edits if edit != ObjectEdit(edit.name)]
    outdate_truths(document, [e.name for e in edits if e.name in tables or not e.removed])
    copies: dict[Path, Path] = {}
    added: dict[str, Path] = {}
    texts: list[str] = []
    for edit in edits:
        table = tables.get(edit.name)
        if edit.removed:
            _remove(document, edit.name)
        elif table is not None:
            _edit_table(table, edit, scene)
        elif edit.path is not None and edit.to_world is not None:
            files, target = mesh_copies(scene.root, MeshFile(edit.path, None), edit.name, copies)
            copies |= files
            material = None if edit.material is None else _material_table(edit, scene)
            to_world = np.reshape(np.array(edit.to_world), (4, 4))
            texts.append(object_text(edit.name, target, to_world, material))
            added[edit.name] = scene.root / target
    shown = [_show(document, name) for name in added]
    if look is not None and look.view.projection == "perspective":
        texts += _keep(document, look, needed=not all(shown))
    for copy in copies:
        require_inside(copy, scene.within)
    text = tomlkit.dumps(document)
    if texts:
        text = "\n".join([text.rstrip("\r\n") + "\n", *texts])
    try:
        parse_manifest(text, str(path))
    except SceneError as error:
        raise SceneError(
            f"{path}: the edits do not fit into it: {error}", several_lines=error.several_lines
        ) from error
    with copied(copies), replacing(path) as temporary:
        temporary.write_bytes(text.encode("utf-8"))
    return added


def _remove(document: Any, name: str) -> None:
    """Take an object out, and its name from the views that show it."""
    objects = document.get("objects", ())
    for number in reversed(range(len(objects))):
        if objects[number]["name"] == name:
            del objects[number]
    if "objects" in document and not objects:
        del document["objects"]  # `objects = []` would forbid the tables of new ones
    for view in document.get("views", ()):
        if name in view.get("objects", ()):
            view["objects"].remove(name)


def _show(document: Any, name: str) -> bool:
    """Put a new object into the views that list theirs, but those with a truth.

    Returns
    -------
    bool
        All views show it.
    """
    everywhere = True
    for view in document.get("views", ()):
        if "objects" in view and "truth" not in view:
            view["objects"].append(name)
        elif "objects" in view:
            everywhere = False
    return everywhere


def _keep(document: Any, look: Look, *, needed: bool) -> list[str]:
    """Have the view `SAVED_VIEW` look so; its text, where it is `needed` and not there yet."""
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


def _edit_table(table: Any, edit: ObjectEdit, scene: Scene) -> None:
    if edit.to_world is not None:
        table["to_world"] = matrix_array(np.reshape(edit.to_world, (4, 4)))
    if edit.material is not None:
        table["material"] = inline(_material_table(edit, scene))


def _material_table(edit: ObjectEdit, scene: Scene) -> dict[str, Any]:
    """The new `material` table."""
    material = edit.material
    assert material is not None
    color = "reflectance" if material.kind == "conductor" else "albedo"
    written: dict[str, Any] = {"kind": material.kind, color: list(material.albedo)}
    if material.kind != "diffuse":
        written["alpha"] = material.alpha
    if material.kind == "plastic":
        written["ior"] = material.ior
    if material.texture is not None:
        if material.kind != "diffuse":
            raise SceneError(
                f"object {edit.name}: {material.kind} with a texture cannot be written; choose a "
                "diffuse material, or one without a texture"
            )
        written["texture"] = _texture_name(edit.name, material.texture, scene)
    return written


def _texture_name(name: str, texture: NDArray[np.float32], scene: Scene) -> str:
    """The file that a texture was read from, as the scene names it."""
    for table, entry in zip(scene.manifest.objects, scene.objects, strict=True):
        if isinstance(table.material, DiffuseTable) and table.material.texture is not None:
            known = entry.bound.materials[0].texture
            if known is not None and np.array_equal(known, texture):
                return table.material.texture
    raise SceneError(
        f"object {name}: its texture is in its mesh file, which cannot be written; choose a "
        "material without"
    )
