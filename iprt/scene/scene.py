"""A scene folder, checked when opened; its pictures and meshes are read on demand."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from iprt.errors import SceneError
from iprt.files.safe_reading import anywhere, identity, is_file, require_inside
from iprt.files.toml_tables import problems_error
from iprt.footage.daylight import Daylight
from iprt.footage.found_sun.patches import SunPatches
from iprt.footage.frame import Frame
from iprt.footage.outside_light import OutsideLight, SunChoice
from iprt.footage.prepare.reading import RawFrame, RawFrames
from iprt.footage.prepare.stages import Preparation
from iprt.footage.prepare.steady import steady_frames
from iprt.footage.real_material import GlossSearch, RealMaterial
from iprt.footage.sky import Sky
from iprt.footage.sun import Sun
from iprt.footage.video.source import FrameSource
from iprt.footage.video.stream import Ahead
from iprt.geometry.mesh import Instance
from iprt.scene.found_light import found_light, sun_patches
from iprt.scene.light_edits import LightEdit
from iprt.scene.manifest import MANIFEST_NAME, Manifest, read_manifest
from iprt.scene.objects import SceneObject, load_objects, objects_at
from iprt.scene.real_materials import declared_materials, searched_gloss
from iprt.scene.scene_files import input_files, missing_files
from iprt.scene.scene_view import scene_view


class Scene:
    """A scene folder, whose pictures and meshes are read on demand.

    Parameters
    ----------
    root : Path
        The folder.
    within : Path or None
        Folder that must hold all files, with links resolved; by default the scene's own.

    Attributes
    ----------
    views : dict of str to SceneView
        In the manifest's order.
    """

    def __init__(self, root: Path, manifest: Manifest, within: Path | None = None) -> None:
        self.root = root
        self.manifest = manifest
        self.within = root if within is None else within
        self.source = FrameSource(root, manifest.video, self.within)
        self.raw_frames = RawFrames(self.source)
        names = tuple(table.name for table in manifest.objects)
        self.views = {table.name: scene_view(root, table, names) for table in manifest.views}

    @classmethod
    def open(cls, path: Path, *, allow_outside: bool = False, strict: bool = False) -> Scene:
        """Open a scene folder, or the scene.toml in it.

        Parameters
        ----------
        allow_outside : bool
            Allow links to files outside the folder.
        strict : bool
            Treat any frame without a file as a problem, not only the first.

        Raises
        ------
        SceneError, FormatError
            The manifest has problems, or its files are missing or outside the folder; all are
            listed.
        """
        root = path.parent if path.name == MANIFEST_NAME else path
        manifest_path = root / MANIFEST_NAME
        within = anywhere(root) if allow_outside else root
        if is_file(manifest_path):
            require_inside(manifest_path, within)
        scene = cls(root, read_manifest(manifest_path), within)
        if problems := missing_files(scene, strict=strict):
            raise problems_error(str(manifest_path), problems)
        return scene

    @property
    def name(self) -> str:
        """The scene's name."""
        return self.manifest.name

    @property
    def settings_table(self) -> tuple[dict[str, Any], str]:
        """The manifest's `[settings]`, which the renderer's user may override, and its path."""
        return self.manifest.settings, str(self.root / MANIFEST_NAME)

    @property
    def exposure(self) -> float:
        """Factor on radiance for display: sRGB of exposure times radiance."""
        return self.manifest.exposure

    @property
    def frame_indices(self) -> range:
        """Numbers of the video's frames."""
        return self.source.indices

    def frame(self, index: int | None = None) -> Frame:
        """Read and sanitise a frame; by default the first. Frames are not cached.

        Raises
        ------
        SceneError
            There is no such frame.
        FormatError
            Its files cannot be used.
        """
        return self.preparation()(self.raw_frame(index))

    def raw_frame(self, index: int | None = None) -> RawFrame:
        """Read a frame like `frame`, without filling or cleaning."""
        chosen = self.frame_indices[0] if index is None else index
        self._require_frames([chosen])
        return self.raw_frames.read(chosen)

    def stream(
        self,
        indices: Iterable[int],
        *,
        strict: bool = False,
        drift: bool = True,
        daylight: bool = True,
        ahead: int = 2,
    ) -> Ahead[Frame]:
        """Stream frames of the video, decoded and sanitised ahead on a thread, in the given order.

        An unreadable frame does not end the stream. Its missing parts are taken from the last good
        frame (`SteadyReader`), with one log message per run of such frames.

        Parameters
        ----------
        indices : iterable of int
            Numbers of frames; ascending order is fastest. The thread advances an iterator just
            before it decodes the next frame.
        strict : bool
            Treat an unreadable frame as an error.
        drift : bool
            Estimate the frames' `color_map` (`Drift`).
        daylight : bool
            Apply the scene's `daylight`.
        ahead : int
            Largest number of frames that are ready in advance.

        Returns
        -------
        Ahead
            A context manager that yields an iterator over the frames, which may raise FormatError.
            It can be iterated once. Leaving the context ends the thread.

        Raises
        ------
        SceneError
            There is no such frame.
        """
        if not isinstance(indices, Iterator):
            indices = list(indices)
            self._require_frames(indices)
        raws = steady_frames(self.raw_frames, indices, strict=strict)
        return Ahead(self.preparation(drift=drift, daylight=daylight).frames(raws), ahead)

    def preparation(self, *, drift: bool = True, daylight: bool = True) -> Preparation:
        """Return new stages from raw frames to frames, for one pass over the video."""
        light = self.daylight if daylight else None
        return Preparation(self.source.white, self.real_materials, drift=drift, daylight=light)

    @property
    def clips(self) -> bool:
        """True if bright lights are clipped, so that frames may have a `light`."""
        return math.isfinite(self.source.white)

    def _require_frames(self, indices: Iterable[int]) -> None:
        for index in indices:
            if index not in self.frame_indices:
                first, last = self.frame_indices[0], self.frame_indices[-1]
                raise SceneError(f"{self.name}: no frame {index}; the scene has {first} to {last}")

    @property
    def real_materials(self) -> tuple[RealMaterial, ...]:
        """The glossy real surfaces: found ones (if `gloss` is "auto"), then declared ones.

        Declared surfaces take precedence where they overlap.

        Raises
        ------
        FormatError
            As `declared_materials`.
        """
        found = self.searched_gloss.found if self.manifest.video.gloss == "auto" else ()
        return found + self.declared_materials

    @property
    def sun(self) -> Sun | None:
        """The sun that the panorama does not show: declared, or found if `sun` is "auto"."""
        return self.outside_light.sun

    @property
    def sky(self) -> Sky | None:
        """The sky behind windows where no camera saw it, if `sky` is "auto"."""
        return self.outside_light.sky

    @cached_property
    def outside_light(self) -> OutsideLight:
        """Light from outside that the panorama does not show (`iprt.scene.found_light`)."""
        declared = self.manifest.video.sun
        if isinstance(declared, str):
            return self._found_light("auto" if declared == "auto" else None)
        return self._found_light(declared.sun)

    def _found_light(self, choice: SunChoice) -> OutsideLight:
        return found_light(self.raw_frames, self.manifest, self.real_materials, choice)

    @property
    def found_light(self) -> OutsideLight:
        """The light that is found whatever `sun` is."""
        return self._found_light("auto")

    @property
    def daylight(self) -> Daylight:
        """The light from outside; its brightness is followed over the video."""
        return Daylight(self.sun, self.sun_patches, self.sky)

    def relit(self, edit: LightEdit) -> Scene:
        """Return the scene with edited light; it shares results that the edit does not change."""
        video = edit.applied(self.manifest.video)
        manifest = self.manifest.model_copy(update={"video": video})
        other = Scene(self.root, manifest, self.within)
        shared = ("declared_materials", "searched_gloss")
        vars(other).update((name, vars(self)[name]) for name in shared if name in vars(self))
        return other

    @cached_property
    def sun_patches(self) -> SunPatches | None:
        """The patches by which the sun's brightness is followed (`iprt.scene.found_light`)."""
        if self.sun is None:
            return None
        return sun_patches(self.raw_frames, self.manifest, self.real_materials, self.sun)

    @cached_property
    def searched_gloss(self) -> GlossSearch:
        """The undeclared glossy surfaces, and the planes that stay diffuse.

        Raises
        ------
        FormatError
            As `declared_materials`.
        """
        return searched_gloss(self.raw_frames, self.manifest, self.declared_materials)

    @cached_property
    def declared_materials(self) -> tuple[RealMaterial, ...]:
        """The glossy real surfaces of the manifest, in its order.

        Raises
        ------
        FormatError
            A mask cannot be read or is not twice as wide as high, or the masks are too large in
            total.
        """
        return declared_materials(self.root, self.manifest)

    def time_of(self, index: int) -> float:
        """Return the seconds from the video's first frame to frame `index`: the time of keyframes.

        In a looping video, time restarts with every round, and animated objects with it.
        """
        frames = self.frame_indices
        played = index - frames[0]
        loop = self.manifest.video.loop
        return (played % len(frames) if loop else played) / self.source.fps

    @cached_property
    def objects(self) -> tuple[SceneObject, ...]:
        """All objects, in the manifest's order.

        Raises
        ------
        FormatError
            A mesh or texture cannot be read, or all together are too large.
        """
        return load_objects(self.root, self.manifest, self.within)

    @cached_property
    def instances(self) -> tuple[Instance, ...]:
        """All objects at the time of the first frame, in the manifest's order.

        Raises
        ------
        FormatError
            As `objects`.
        """
        return objects_at(self.objects, 0.0)

    def instances_at(
        self, time_s: float, names: tuple[str, ...] | None = None
    ) -> tuple[Instance, ...]:
        """Return the objects of these names, by default all, at a time (`time_of`).

        Names, order, triangles and materials are the same at all times. Transforms, and vertices of
        meshes that deform, may differ.
        """
        return objects_at(
            (entry for entry in self.objects if names is None or entry.name in names), time_s
        )

    def instances_of(self, view: str | None = None) -> tuple[Instance, ...]:
        """Return the objects that a view shows, or all without a view.

        Raises
        ------
        SceneError
            There is no such view.
        """
        if view is None:
            return self.instances
        if view not in self.views:
            known = ", ".join(self.views) or "none"
            raise SceneError(f"{self.name}: no view is named '{view}'; the views are: {known}")
        return self.instances_named(self.views[view].objects)

    def instances_named(self, names: tuple[str, ...]) -> tuple[Instance, ...]:
        """Return the objects of these names, in the manifest's order."""
        return tuple(instance for instance in self.instances if instance.name in names)

    def require_not_ours(self, *paths: Path) -> None:
        """Refuse outputs that would overwrite the scene's inputs; truths may be overwritten.

        Raises
        ------
        SceneError
            One of `paths` is the manifest, or a file that it names.
        """
        # Compared by identity: links of a long video's files take too long to resolve.
        # By identity: the links of an hour's frames would take long to resolve.
        real = cache(os.path.realpath)  # of a folder, which may not exist yet
        found = {path: identity(Path(real(path.parent), path.name)) for path in paths}
        there = {path: known for path, known in found.items() if known is not None}
        ours = {identity(file) for file in input_files(self)} if there else set()
        for path, known in there.items():
            if known in ours:
                raise SceneError(
                    f"{path}: belongs to the scene and is not overwritten; name another"
                )
