"""A clipboard of objects with their files, by which viewers of different scenes exchange them."""

from __future__ import annotations

import shutil
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import tomlkit
from numpy.typing import NDArray
from platformdirs import user_cache_path
from pydantic import ValidationError

from iprt.errors import FormatError, SceneError
from iprt.files.safe_reading import require_inside
from iprt.files.toml_tables import Table
from iprt.files.toml_text import parse_toml, read_text
from iprt.geometry.ies import read_ies
from iprt.geometry.mesh import Mesh, light_mesh
from iprt.geometry.mesh_files import MeshFile
from iprt.geometry.meshes import load_mesh
from iprt.scene.edit_writing import NewFiles, edited_text
from iprt.scene.light_edits import UNEDITED
from iprt.scene.manifest import MANIFEST_NAME, ObjectTable, parse_manifest
from iprt.scene.object_edits import ObjectEdit, flat
from iprt.scene.objects import own_material
from iprt.scene.placement import bounds
from iprt.scene.scene import Scene

OBJECTS = "objects.toml"
KEPT, KEPT_NS = 8, 7 * 24 * 3600 * 10**9
"""Number of the newest copies, and age of further ones in nanoseconds, that are kept: pasted
objects need their files until they are saved."""


class _Copied(Table):
    """The contents of `OBJECTS`."""

    objects: list[ObjectTable]


@dataclass(frozen=True)
class Copied:
    """Objects of the clipboard.

    Attributes
    ----------
    edits : tuple of ObjectEdit
        Edits that add them, with the names that they had.
    foot : (3,) float64
        Centre of the bottom of the box around all.
    lost : tuple of str
        Names of objects whose animation stays behind.
    """

    edits: tuple[ObjectEdit, ...]
    foot: NDArray[np.float64]
    lost: tuple[str, ...]


def default_folder() -> Path:
    """Return the user's folder of copies; it may not exist."""
    return user_cache_path("iprt") / "clipboard"


def copy_objects(
    scene: Scene, text: str, edits: Sequence[ObjectEdit], names: Collection[str], folder: Path
) -> None:
    """Put objects on the clipboard.

    Parameters
    ----------
    scene : Scene
        The scene without the edits.
    text : str
        Its scene.toml.
    edits : sequence of ObjectEdit
    names : collection of str
        Names of the objects.
    folder : Path
        Folder of copies.

    Raises
    ------
    SceneError, FormatError
        The objects cannot be copied; the clipboard is unchanged.
    """
    new = NewFiles(scene, scene.root)
    made = edited_text(new, edits, UNEDITED, text)
    manifest = parse_manifest(made, str(scene.root / MANIFEST_NAME))
    raw = {str(table["name"]): table for table in parse_toml(made).get("objects", ())}
    wanted = [table for table in manifest.objects if table.name in names]
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        place = Path(mkdtemp(prefix=".", dir=folder))
        try:
            with new.sources() as copies:
                for target, source in _files(scene.root, wanted, copies):
                    (place / target).parent.mkdir(parents=True, exist_ok=True)
                    shutil.copyfile(source, place / target)
            tables = {"objects": [raw[table.name] for table in wanted]}
            (place / OBJECTS).write_text(tomlkit.dumps(tables), "utf-8")
            place.rename(folder / f"{time.time_ns():020d}")
        except BaseException:
            shutil.rmtree(place, ignore_errors=True)
            raise
    except OSError as error:
        raise FormatError(f"{folder}: cannot be written ({error.strerror})") from error
    for old in _copies(folder)[:-KEPT]:
        if int(old.name) < time.time_ns() - KEPT_NS:
            shutil.rmtree(old, ignore_errors=True)


def _files(
    root: Path, tables: Sequence[ObjectTable], copies: Mapping[Path, Path]
) -> Iterator[tuple[str, Path]]:
    """Yield the files of objects: their paths in the clipboard, and their sources."""
    for table in tables:
        names = [] if table.material is None else list(table.material.maps.values())
        names += [name for name in [getattr(table.light, "profile", None)] if name is not None]
        for name in names:
            yield name, copies.get(root / name, root / name)
        if table.mesh is not None:
            source = copies.get(root / table.mesh, root / table.mesh)
            yield table.mesh, source
            for path in MeshFile(source).references.values():
                yield (Path(table.mesh).parent / path).as_posix(), source.parent / path


def copied_objects(folder: Path, nits: float) -> Copied:
    """Read the newest objects of the clipboard.

    Parameters
    ----------
    folder : Path
        Folder of copies.
    nits : float
        The scene's luminance of a radiance of 1, in cd/m².

    Raises
    ------
    SceneError, FormatError
        There are none, or they cannot be read.
    """
    copies = _copies(folder)
    if not copies:
        raise SceneError("nothing is copied yet; first select objects and press Ctrl+C")
    place = copies[-1]
    try:
        tables = _Copied.model_validate(parse_toml(read_text(place / OBJECTS))).objects
    except (OSError, ValueError, ValidationError) as error:
        raise FormatError(f"{place / OBJECTS}: is damaged; copy the objects again") from error
    edits, corners = [], []
    for table in tables:
        edit, mesh = _edit(place, table, nits)
        edits.append(edit)
        to_world = np.reshape(np.array(table.to_world), (4, 4))
        corners += [corner + to_world[:3, 3] for corner in bounds(mesh, to_world[:3, :3])]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    foot = np.array([0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])])
    lost = tuple(table.name for table in tables if table.animation is not None)
    return Copied(tuple(edits), foot, lost)


def _edit(place: Path, table: ObjectTable, nits: float) -> tuple[ObjectEdit, Mesh]:
    """Return the edit that adds an object, and its mesh."""
    to_world = flat(np.array(table.to_world))
    maps = {} if table.material is None else table.material.maps
    for name in filter(None, (table.mesh, *maps.values(), getattr(table.light, "profile", None))):
        require_inside(place / name, place)
    keys = tuple(table.keyframes) or None
    given = ObjectEdit(table.name, to_world, group=table.group, keyframes=keys)
    if table.light is not None:
        profile = getattr(table.light, "profile", None)
        luminaire = None if profile is None else read_ies(place / profile)
        mesh = light_mesh(table.light.light(nits, luminaire))
        return replace(given, light=table.light), mesh
    assert table.mesh is not None
    mesh = load_mesh(place / table.mesh, None, place)
    material = own_material(place, table)
    return replace(given, material=material, mesh=mesh, path=place / table.mesh), mesh


def _copies(folder: Path) -> list[Path]:
    """Return the folders of copies, the newest last."""
    with suppress(OSError):
        return sorted(path for path in folder.iterdir() if path.name.isdigit())
    return []
