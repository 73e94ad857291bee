"""An opened scene: what its folder holds, checked, and read when it is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError, SceneError
from iprt.scene.camera import View
from iprt.scene.frame import Frame
from iprt.scene.gloss import RealMaterial, with_gloss
from iprt.scene.images import read_color
from iprt.scene.manifest import (
    MANIFEST_NAME,
    DiffuseTable,
    Manifest,
    ObjectTable,
    ViewTable,
    read_manifest,
)
from iprt.scene.manifest_problems import problems_error
from iprt.scene.material import Material
from iprt.scene.mesh import Instance, Mesh
from iprt.scene.meshes import load_mesh
from iprt.scene.source import FrameSource, RawFrame, frame_path


@dataclass(frozen=True)
class SceneView:
    """A view of the scene and its truth.

    Attributes
    ----------
    name : str
    view : View
    objects : tuple of str
        Names of the objects that it shows.
    truth, truth_background, truth_mask : Path or None
        Path-traced pictures with and without the objects, and the objects' coverage; absolute,
        possibly with a printf pattern for the frame's number (`frame_path`).
    cuts : tuple of (x0, y0, x1, y1)
        Crops in pixels.
    """

    name: str
    view: View
    objects: tuple[str, ...]
    truth: Path | None
    truth_background: Path | None
    truth_mask: Path | None
    cuts: tuple[tuple[int, int, int, int], ...]


class Scene:
    """A scene folder. Pictures and meshes are read when they are asked for.

    Parameters
    ----------
    root : Path
        The folder.
    manifest : Manifest

    Attributes
    ----------
    views : dict of str to SceneView
        In the manifest's order.
    source : FrameSource
    """

    def __init__(self, root: Path, manifest: Manifest) -> None:
        self.root = root
        self.manifest = manifest
        self.source = FrameSource(root, manifest.video)
        names = tuple(table.name for table in manifest.objects)
        self.views = {table.name: _scene_view(root, table, names) for table in manifest.views}

    @classmethod
    def open(cls, path: Path) -> Scene:
        """Open a scene folder, or the scene.toml in it.

        Raises
        ------
        SceneError
            All problems with the manifest, or else all files that it names and that are missing.
        """
        root = path.parent if path.name == MANIFEST_NAME else path
        manifest_path = root / MANIFEST_NAME
        scene = cls(root, read_manifest(manifest_path))
        if problems := scene._missing_files():
            raise problems_error(str(manifest_path), problems)
        return scene

    @property
    def name(self) -> str:
        return self.manifest.name

    @property
    def exposure(self) -> float:
        """Display = sRGB of exposure times radiance."""
        return self.manifest.exposure

    @cached_property
    def size(self) -> tuple[int, int]:
        """Width and height of the panorama in pixels."""
        return self.source.size()

    @property
    def width(self) -> int:
        return self.size[0]

    @property
    def height(self) -> int:
        return self.size[1]

    @property
    def frame_indices(self) -> range:
        return self.source.indices

    def frame(self, index: int | None = None) -> Frame:
        """Read and sanitise a frame; the first by default. Not kept.

        Raises
        ------
        SceneError
            No such frame.
        FormatError
            Its files cannot be used.
        """
        return self.sanitised(self.raw_frame(index))

    def sanitised(self, raw: RawFrame) -> Frame:
        """A frame as read to one as it is rendered: cleaned, its glossy surfaces known."""
        return with_gloss(raw.sanitised(), self.real_materials)

    def raw_frame(self, index: int | None = None) -> RawFrame:
        """As `frame`, before anything is filled or cleaned."""
        chosen = self.frame_indices[0] if index is None else index
        if chosen not in self.frame_indices:
            first, last = self.manifest.video.frames
            raise SceneError(f"{self.name}: no frame {chosen}; the scene has {first} to {last}")
        return self.source.read(chosen)

    @cached_property
    def real_materials(self) -> tuple[RealMaterial, ...]:
        """The glossy real surfaces, in the manifest's order.

        Raises
        ------
        FormatError
            A mask cannot be read, or is not twice as wide as high.
        """
        return tuple(
            table.real_material(None if table.mask is None else self._mask(self.root / table.mask))
            for table in self.manifest.real_materials
        )

    def _mask(self, path: Path) -> NDArray[np.bool_]:
        """The mask (h, w) in a file, turned as the pictures of `[video]` are."""
        mask = (read_color(path) > 0.0).any(axis=-1)
        height, width = mask.shape
        if width != 2 * height:
            raise FormatError(
                f"{path}: {width} x {height} pixels; a mask covers the whole panorama and is twice "
                "as wide as high"
            )
        columns = self.manifest.video.yaw_offset_deg / 360.0 * width
        return np.roll(mask, int(np.floor(columns + 0.5)), axis=1)

    @cached_property
    def instances(self) -> tuple[Instance, ...]:
        """All objects, in the manifest's order.

        Raises
        ------
        FormatError
            A mesh or texture cannot be read.
        """
        meshes: dict[str, Mesh] = {}
        return tuple(self._instance(table, meshes) for table in self.manifest.objects)

    def instances_of(self, view: str | None = None) -> tuple[Instance, ...]:
        """The objects that a view shows; all without a view.

        Raises
        ------
        SceneError
            No such view.
        """
        if view is None:
            return self.instances
        if view not in self.views:
            known = ", ".join(self.views) or "none"
            raise SceneError(f"{self.name}: no view is named '{view}'; the views are: {known}")
        return self.instances_named(self.views[view].objects)

    def instances_named(self, names: tuple[str, ...]) -> tuple[Instance, ...]:
        """The objects of these names, in the manifest's order."""
        return tuple(instance for instance in self.instances if instance.name in names)

    def _instance(self, table: ObjectTable, meshes: dict[str, Mesh]) -> Instance:
        """An instance; meshes that keep their own materials are shared between instances."""
        to_world = np.array(table.to_world, np.float64).reshape(4, 4)
        material = self._material(table)
        if material is not None:
            return Instance(table.name, load_mesh(self.root / table.mesh, material), to_world)
        if table.mesh not in meshes:
            meshes[table.mesh] = load_mesh(self.root / table.mesh)
        return Instance(table.name, meshes[table.mesh], to_world)

    def _material(self, table: ObjectTable) -> Material | None:
        if table.material is None:
            return None
        if isinstance(table.material, DiffuseTable) and table.material.texture is not None:
            return table.material.material(read_color(self.root / table.material.texture))
        return table.material.material()

    def require_not_ours(self, path: Path) -> None:
        """Keep an output from replacing what the scene is made of; truths may be replaced.

        Raises
        ------
        SceneError
            `path` is the manifest, or a picture, mesh, texture or mask that it names.
        """
        names = [MANIFEST_NAME, *(table.mesh for table in self.manifest.objects)]
        names += [table.mask or "" for table in self.manifest.real_materials]
        names += [getattr(table.material, "texture", None) or "" for table in self.manifest.objects]
        ours = {self.root / name for name in names if name}
        for index in self.frame_indices:
            ours.update(self.source.files(index).values())
        if path.resolve() in {file.resolve() for file in ours}:
            raise SceneError(f"{path}: belongs to the scene and is not overwritten; name another")

    def _missing_files(self) -> list[str]:
        problems = self.source.problems()
        for table in self.manifest.objects:
            texture = getattr(table.material, "texture", None)
            named = {f"objects.{table.name}.mesh": table.mesh}
            named |= {f"objects.{table.name}.material.texture": texture} if texture else {}
            problems += [
                f"{key}: there is no file {name}"
                for key, name in named.items()
                if not (self.root / name).is_file()
            ]
        problems += [
            f"real_materials.{table.name}.mask: there is no file {table.mask}"
            for table in self.manifest.real_materials
            if table.mask is not None and not (self.root / table.mask).is_file()
        ]
        for view in self.manifest.views:
            for key in ("truth", "truth_background", "truth_mask"):
                name = getattr(view, key)
                if name is not None and not self._has_any_frame(name):
                    problems.append(f"views.{view.name}.{key}: there is no file {name}")
        return problems

    def _has_any_frame(self, pattern: str) -> bool:
        return any(frame_path(self.root, pattern, i).is_file() for i in self.frame_indices)


def _scene_view(root: Path, table: ViewTable, all_objects: tuple[str, ...]) -> SceneView:
    def absolute(name: str | None) -> Path | None:
        return None if name is None else root / name

    return SceneView(
        name=table.name,
        view=table.view,
        objects=all_objects if table.objects is None else tuple(table.objects),
        truth=absolute(table.truth),
        truth_background=absolute(table.truth_background),
        truth_mask=absolute(table.truth_mask),
        cuts=tuple((x0, y0, x1, y1) for x0, y0, x1, y1 in table.cuts),
    )
