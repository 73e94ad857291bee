"""The objects of a scene: loading their meshes, and their placement over time."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.safe_reading import MAX_PIXELS, MAX_TRIANGLES
from iprt.geometry.animated_mesh import AnimatedMesh, load_animated_mesh
from iprt.geometry.ies import Luminaire, read_ies
from iprt.geometry.keyframes import ObjectMotion
from iprt.geometry.material import NORMAL_MAPS, Material
from iprt.geometry.mesh import Instance, Mesh, light_mesh, tangent_mesh
from iprt.geometry.mesh_materials import DEFAULT_MATERIAL
from iprt.geometry.meshes import load_mesh
from iprt.geometry.solids import OPEN, solids, swollen, with_solids
from iprt.scene.light_tables import LightTable, PointTable
from iprt.scene.manifest import Manifest, ObjectTable
from iprt.scene.material_maps import MapName, read_map, with_maps

LOG = logging.getLogger(__name__)
AnyMesh = Mesh | AnimatedMesh
ReadMap = Callable[[Path, MapName], NDArray[np.float32]]
"""`read_map`, which may remember what it has read."""


@dataclass(frozen=True)
class SceneLight:
    """A light of a scene.

    Attributes
    ----------
    table : LightTable
        Its description in `scene.toml`.
    nits : float
        The scene's luminance of a radiance of 1, in cd/m².
    luminaire : Luminaire or None
        Content of the photometric file that the table names.
    """

    table: LightTable
    nits: float
    luminaire: Luminaire | None = None

    @classmethod
    def read(cls, table: LightTable, root: Path, nits: float) -> Self:
        """Read a light with its photometric file, named relative to the folder `root`.

        Raises
        ------
        FormatError
            The file cannot be read.
        """
        named = table.profile if isinstance(table, PointTable) else None
        return cls(table, nits, None if named is None else read_ies(root / named))

    def mesh(self) -> Mesh:
        """Return the light as an object's mesh."""
        named = isinstance(self.table, PointTable) and self.table.profile is not None
        return light_mesh(self.table.light(self.nits, self.luminaire if named else None))


@dataclass(frozen=True)
class SceneObject:
    """An object with its motion.

    Attributes
    ----------
    name : str
    mesh : Mesh or AnimatedMesh
    motion : ObjectMotion
    light : SceneLight or None
        A light without geometry, which `mesh` marks the place of.
    group : str
        Name of the group that viewers select and move as one; "" for none.
    locked : bool
        True if viewers do not change the object.
    """

    name: str
    mesh: AnyMesh
    motion: ObjectMotion
    light: SceneLight | None = None
    group: str = ""
    locked: bool = False

    @property
    def bound(self) -> Mesh:
        """The mesh with the triangles and materials of all times."""
        return self.mesh.bound if isinstance(self.mesh, AnimatedMesh) else self.mesh

    def describe(self) -> tuple[str, ...]:
        """Describe the motion, one phrase each; empty if the object is static."""
        phrases = [self.motion.describe()]
        if isinstance(self.mesh, AnimatedMesh):
            clip = self.mesh.clip
            phrases.append(f"animation '{clip.name}' of {clip.duration:g} s")
        return tuple(phrase for phrase in phrases if phrase is not None)


def objects_at(objects: Iterable[SceneObject], time_s: float) -> tuple[Instance, ...]:
    """Return the objects at a time; objects that share a mesh share its deformed copy."""
    bent: dict[int, Mesh] = {}
    instances = []
    for entry in objects:
        mesh = entry.mesh
        if isinstance(mesh, AnimatedMesh):
            if id(mesh) not in bent:
                bent[id(mesh)] = mesh.at(time_s)
            mesh = bent[id(mesh)]
        instances.append(Instance(entry.name, mesh, entry.motion.at(time_s)))
    return tuple(instances)


def load_objects(root: Path, manifest: Manifest, within: Path) -> tuple[SceneObject, ...]:
    """Read the meshes and textures of all objects, in the manifest's order.

    Parameters
    ----------
    root : Path
        The scene's folder.
    within : Path
        Folder that must hold all files, with links resolved.

    Raises
    ------
    FormatError
        A file cannot be read, or all together are too large.
    """
    read = cache(read_map)

    @cache  # objects may share meshes
    def mesh(name: str, animation: str | int | None, material: Material | None) -> AnyMesh:
        if animation is None:
            return load_mesh(root / name, material, within)
        return load_animated_mesh(root / name, animation, material, within)

    def shaped(table: ObjectTable) -> AnyMesh:
        assert table.mesh is not None
        own = own_material(root, table, read)
        loaded = mesh(table.mesh, table.animation, None if own is None else DEFAULT_MATERIAL)
        if own is not None:
            loaded = painted(loaded, own)
            if OPEN in _bound(loaded).warnings:
                LOG.warning("%s: %s", root / table.mesh, OPEN)
        return loaded

    objects: list[SceneObject] = []
    for table in manifest.objects:
        to_world = np.array(table.to_world, np.float64).reshape(4, 4)
        motion = ObjectMotion.of(to_world, table.keyframes)
        light = None
        if table.light is not None:
            light = SceneLight.read(table.light, root, manifest.nits)
        made = shaped(table) if light is None else light.mesh()
        group = table.group or ""
        objects.append(SceneObject(table.name, made, motion, light, group, table.locked))
        _require_readable(manifest.name, [entry.bound for entry in objects])
    return tuple(_overlapping(objects))


def own_material(root: Path, table: ObjectTable, read: ReadMap = read_map) -> Material | None:
    """Return the material that an object's table has, with its maps; None without one.

    Raises
    ------
    FormatError
        A map cannot be read, or the maps do not fit together.
    """
    own = table.material
    if own is None:
        return None
    maps = {key: read(root / name, key) for key, name in own.maps.items()}
    try:
        return with_maps(own.finished(own.material()), maps)
    except FormatError as error:
        raise FormatError(f"{root}: objects.{table.name}.material: {error}") from error


def _overlapping(objects: list[SceneObject]) -> list[SceneObject]:
    """Return the objects with `swollen` solids, if there are several; animated ones stay."""
    if sum(len(solids(entry.bound)) for entry in objects) < 2:
        return objects
    larger = {
        id(entry.mesh): swollen(entry.mesh)
        for entry in objects
        if isinstance(entry.mesh, Mesh) and solids(entry.mesh)
    }
    return [replace(entry, mesh=larger.get(id(entry.mesh), entry.mesh)) for entry in objects]


def painted(mesh: AnyMesh, material: Material) -> AnyMesh:
    """Return the mesh with a single material; a dielectric, as `with_solids` makes it.

    An animated mesh without tangents gets no normal map, with a warning.
    """
    plain = _bound(mesh)
    place = material.places[1]
    elsewhere = any(one.places[1] != place for one in plain.materials)
    bumpy = any(material.maps[at] is not None for at in NORMAL_MAPS)
    if bumpy and (plain.tangents is None or elsewhere):
        if isinstance(mesh, AnimatedMesh):
            LOG.warning("%s: an animated mesh takes normal maps only from its own file", mesh.path)
            material = replace(material, normal_texture=None, clearcoat_normal_texture=None)
        else:
            plain = tangent_mesh(plain, place)
    one = len(plain.materials) == 1
    index = plain.material_index if one else np.zeros_like(plain.material_index)
    made = with_solids(replace(plain, materials=(material,), material_index=index))
    return replace(mesh, bound=made) if isinstance(mesh, AnimatedMesh) else made


def _bound(mesh: AnyMesh) -> Mesh:
    return mesh.bound if isinstance(mesh, AnimatedMesh) else mesh


def _require_readable(scene: str, meshes: list[Mesh]) -> None:
    """Raise FormatError if the objects have too many triangles or texels in total."""
    arrays: dict[int, NDArray[np.int32]] = {}
    textures: dict[int, NDArray[Any]] = {}
    for mesh in meshes:
        arrays[id(mesh.triangles)] = mesh.triangles
        for material in mesh.materials:
            variants = () if material.variants is None else (material.variants.index,)
            for texture in (*material.maps, *variants):
                if texture is not None:
                    textures[id(texture)] = texture
    triangles = sum(len(array) for array in arrays.values())
    texels = sum(texture.shape[0] * texture.shape[1] for texture in textures.values())
    if triangles > MAX_TRIANGLES or texels > MAX_PIXELS:
        raise FormatError(
            f"{scene}: its objects have {triangles} triangles and {texels} pixels of textures; "
            f"at most {MAX_TRIANGLES} and {MAX_PIXELS} are read"
        )
