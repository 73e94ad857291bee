"""Changes to `scene.toml` and to the files beside it, all or nothing."""

from __future__ import annotations

import fcntl
import filecmp
import os
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray

from iprt.errors import SceneError
from iprt.files.atomic import replacing
from iprt.files.termination import undisturbed
from iprt.files.toml_text import parse_toml
from iprt.footage.real_material import RealMaterial
from iprt.geometry.mesh_files import MeshFile
from iprt.scene.manifest import AUTOSAVE_NAME, MANIFEST_NAME, manifest_text, parse_manifest

VIEW_SIZE = (1024, 768)


@contextmanager
def copied(copies: dict[Path, Path]) -> Iterator[None]:
    """Copy files (target -> source), and delete the new ones if the block fails.

    Raises
    ------
    SceneError
        A different file has the target's name.
    """
    for target, source in copies.items():
        if target.exists() and not filecmp.cmp(source, target, shallow=False):
            raise SceneError(f"{target}: another file has this name; move it away first")
    folders = [folder for target in copies for folder in [target.parent, *target.parent.parents]]
    new_folders = list(dict.fromkeys(folder for folder in folders if not folder.exists()))
    new_files: list[Path] = []
    with undisturbed():
        try:
            for target, source in copies.items():
                if not target.exists():
                    new_files.append(target)
                    with replacing(target) as temporary:
                        shutil.copyfile(source, temporary)
            yield
        except BaseException:
            for file in new_files:
                with suppress(OSError):
                    file.unlink()
            for folder in sorted(new_folders, key=lambda path: -len(path.parts)):
                with suppress(OSError):
                    folder.rmdir()
            raise


@contextmanager
def changing(folder: Path) -> Iterator[None]:
    """Lock a scene folder against changes by other processes during the block.

    It waits for other processes. File systems without locks are not protected. A missing scene is
    left for the block to find.

    Raises
    ------
    SceneError
        scene.toml is read-only.
    """
    path = folder / MANIFEST_NAME
    with suppress(OSError):
        # In a writable folder even read-only files could be replaced.
        writable = path.stat().st_mode & 0o222 and os.access(path, os.W_OK)
        if not writable:
            raise SceneError(f"{path}: is read-only; make it writable to change the scene")
    handle = None
    try:
        with suppress(OSError):
            handle = os.open(folder, os.O_RDONLY)
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        if handle is not None:
            os.close(handle)


def extended(text: str, tables: Iterable[str]) -> str:
    """Return a manifest with further tables; TOML allows `[[objects]]` after other tables."""
    return "\n".join([text.rstrip("\r\n") + "\n", *tables])


def write_manifest(
    root: Path, text: str, complaint: str, copies: dict[Path, Path] | None = None
) -> None:
    """Write the changed text of `scene.toml`, and copy files beside it (target -> source).

    Raises
    ------
    SceneError
        The text is no valid manifest, as `complaint` says; nothing has been written.
    FormatError
        A file cannot be written, or a copy would lie outside the folder.
    """
    path = root / MANIFEST_NAME
    try:
        parse_toml(text)
    except ValueError as error:
        raise SceneError(
            f"{path}: cannot be extended; write objects, real_materials and views as [[objects]], "
            "[[real_materials]] and [[views]] tables"
        ) from error
    try:
        parse_manifest(text, str(path))
    except SceneError as error:
        raise SceneError(f"{complaint}: {error}", several_lines=error.several_lines) from error
    with copied(copies or {}), replacing(path) as temporary:
        temporary.write_bytes(text.encode("utf-8"))


def table_text(key: str, **values: Any) -> str:
    """Return an entry of a list of tables of `scene.toml`, of the values that are not None."""
    return tomlkit.dumps({key: [{k: v for k, v in values.items() if v is not None}]})


def matrix_array(to_world: NDArray[np.float64]) -> tomlkit.items.Array:
    """Return a (4, 4) transform as TOML, a row a line."""
    rows = tomlkit.array()
    # What rounding leaves of zeros is 0: elements of one column have the same unit.
    least = 1e-9 * np.abs(to_world).max(axis=0)
    for row in np.where(np.abs(to_world) < least, 0.0, to_world):
        rows.add_line(*(float(f"{value:.7g}") for value in row), indent="  ")
    rows.add_line(indent="")
    return rows


def inline(values: Mapping[str, Any]) -> tomlkit.items.InlineTable:
    """Return a table in one line of TOML."""
    table = tomlkit.inline_table()
    table.update(values)
    return table


def object_text(**values: Any) -> str:
    """Return an `[[objects]]` table of `scene.toml`, of the values that are not None.

    A transform (4, 4) takes a line per row, tables take one line each.
    """

    def written(value: Any) -> Any:
        if isinstance(value, tomlkit.items.Item):
            return value
        if isinstance(value, np.ndarray):
            return matrix_array(value)
        if isinstance(value, Mapping):
            return inline(value)
        if isinstance(value, list):
            rows = tomlkit.array()
            for row in value:
                rows.add_line(written(row), indent="  ")
            rows.add_line(indent="")
            return rows
        return value

    return table_text("objects", **{key: written(value) for key, value in values.items()})


def outdate_truths(document: Any, names: Iterable[str]) -> bool:
    """Mark the truths of a `scene.toml` that show edited objects; return True if there are any.

    Parameters
    ----------
    document : tomlkit document
        The document before the edits.
    names : iterable of str
        Names of objects that are moved, painted, removed, or new.
    """
    edited, found = set(names), False
    for view in document.get("views", ()):
        if "truth" in view and not edited.isdisjoint(view.get("objects", edited)):
            view["truth_outdated"] = found = True
    return found


def show_object(document: Any, name: str) -> bool:
    """Add a new object to the views that list their objects, except views with a truth.

    Returns
    -------
    bool
        True if all views show it.
    """
    everywhere = True
    for view in document.get("views", ()):
        if "objects" in view and "truth" not in view:
            view["objects"].append(name)
        elif "objects" in view:
            everywhere = False
    return everywhere


def mesh_copies(
    root: Path,
    file: MeshFile,
    name: str,
    others: Mapping[Path, Path] | None = None,
    home: Path | None = None,
) -> tuple[dict[Path, Path], str]:
    """Return the files to copy (target -> source), and the mesh's path in the manifest.

    Parameters
    ----------
    root : Path
        The scene's folder.
    name : str
        The object's name.
    others : mapping of Path to Path or None
        Other files that will be copied (target -> source).
    home : Path or None
        The folder in the scene's that gets the copies; by default the scene's.
    """
    mesh, references = file.path, dict.fromkeys(file.references.values())
    home = root if home is None else home
    real, scene = mesh.resolve(), root.resolve()
    # Autosaved files do not last, except for the autosave that they belong to.
    passing = real.is_relative_to(scene / AUTOSAVE_NAME)
    if passing and home != root:
        passing = not real.is_relative_to(home.resolve())
    if real.is_relative_to(scene) and not passing:
        return {}, real.relative_to(scene).as_posix()
    # Files that refer to each other share a folder, apart from equally named files of other meshes.
    folder, others = home / "meshes", others or {}
    there = {target: target for target in folder.iterdir()} if folder.is_dir() else {}
    there |= others
    inside = (target.relative_to(folder) for target in there if target.is_relative_to(folder))
    taken = {Path(path.parts[0]).stem for path in inside}
    if references:
        folder = folder / free_name(name, taken)
        target = folder / mesh.name
    else:
        target = folder / mesh.name
        if target in there and not filecmp.cmp(mesh, there[target], shallow=False):
            target = folder / (free_name(mesh.stem, taken) + mesh.suffix)
    copies = {target: mesh} | {folder / path: mesh.parent / path for path in references}
    return copies, target.relative_to(root).as_posix()


def free_name(wanted: str, taken: set[str]) -> str:
    """Return a valid name that is not taken, with a number if needed."""
    base = re.sub(r"[^\w. -]", "_", wanted).strip() or "object"
    number = 2
    name = base
    while name in taken:
        name = f"{base}-{number}"
        number += 1
    return name


def declaration(material: RealMaterial) -> str:
    """Return the `[[real_materials]]` table of a coat on a plane, with a comment of evidence."""
    plane, evidence, coat = material.plane, material.evidence, material.material
    assert plane is not None
    table = table_text(
        "real_materials",
        name=material.name,
        kind=coat.kind,
        alpha=coat.alpha,
        ior=coat.ior,
        plane=inline(vars(plane)),
    )
    return (f"# {evidence.line()}\n" if evidence is not None else "") + table


def declare(root: Path, materials: Iterable[RealMaterial]) -> None:
    """Append declarations to the `scene.toml` of a folder, and keep the rest of the file.

    Raises
    ------
    SceneError
        The file cannot be extended, or is read-only; nothing has been written.
    FormatError
        The file cannot be written.
    """
    with changing(root):
        before = manifest_text(root / MANIFEST_NAME)
        text = extended(before, [declaration(material) for material in materials])
        write_manifest(root, text, "cannot be extended")
