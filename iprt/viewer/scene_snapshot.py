"""A scene with unsaved edits in a folder of its own, for another process."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import tomlkit

from iprt.scene.edit_writing import save_edits
from iprt.scene.light_edits import LightEdit
from iprt.scene.manifest import AUTOSAVE_NAME, MANIFEST_NAME, manifest_text
from iprt.scene.object_edits import ObjectEdit
from iprt.scene.scene import Scene
from iprt.scene.view_edits import ViewEdit


@dataclass(frozen=True, eq=False)
class EditedScene:
    """A scene with its edits, as they are at one moment.

    Attributes
    ----------
    origin : Scene
        The scene without the edits.
    text : str
        Its scene.toml.
    edits : tuple of ObjectEdit
    light : LightEdit
    views : tuple of ViewEdit
    """

    origin: Scene
    text: str
    edits: tuple[ObjectEdit, ...]
    light: LightEdit
    views: tuple[ViewEdit, ...] = ()

    def write(self, folder: Path, view: str | None, shown: tuple[str, ...] | None) -> None:
        """Write the edited scene to a new folder, as saving would; its other files become links.

        Parameters
        ----------
        view : str or None
            View of the scene that is to show the objects, or None for any other.
        shown : tuple of str or None
            Names of the objects to show; None for all. Others are left out where the view does not
            leave them out itself.

        Raises
        ------
        IprtError
            The edits cannot be saved.
        OSError
            The folder cannot be written.
        """
        _link_files(self.origin, folder)
        path = folder / MANIFEST_NAME
        path.unlink(missing_ok=True)
        path.write_text(self.text, "utf-8")
        save_edits(_opened(folder), self.edits, light=self.light, views=self.views)
        scene = _opened(folder)
        names = {table.name for table in scene.manifest.objects}
        wanted = names if shown is None else names.intersection(shown)
        if wanted != (names if view is None else set(scene.views[view].objects)):
            hidden = [ObjectEdit(name, removed=True) for name in sorted(names - wanted)]
            save_edits(scene, hidden, base=_without_list(manifest_text(path), view))
        for file in folder.rglob("*"):
            if not file.is_symlink():  # a later snapshot is to count as the same scene
                os.utime(file, ns=(0, 0))


def _opened(folder: Path) -> Scene:
    return Scene.open(folder, allow_outside=True)  # as all links lead out of it


def _link_files(scene: Scene, folder: Path) -> None:
    """Fill a new folder with links to the files of a scene's folder that the scene may read."""
    root, within = Path(os.path.realpath(scene.root)), os.path.realpath(scene.within)
    for place, folders, files in os.walk(root, followlinks=True):
        here, real = Path(place), Path(os.path.realpath(place))
        # Links to folders above have no end.
        folders[:] = [
            name
            for name in folders
            if not real.is_relative_to(os.path.realpath(here / name)) and name != AUTOSAVE_NAME
        ]
        target = folder / here.relative_to(root)
        target.mkdir()
        for name in files:
            source = os.path.realpath(here / name)
            if Path(source).is_relative_to(within):
                (target / name).symlink_to(source)


def _without_list(text: str, view: str | None) -> str:
    """Return a manifest in which a view shows all objects."""
    document = tomlkit.parse(text)
    for table in document.get("views", ()):
        if table["name"] == view:
            table.pop("objects", None)
    return tomlkit.dumps(document)
