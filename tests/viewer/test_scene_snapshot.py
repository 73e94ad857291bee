"""Snapshots of edited scenes: the scene as saving would write it, beside links to its files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from iprt.scene.edit_writing import save_edits
from iprt.scene.light_edits import UNEDITED, LightEdit
from iprt.scene.manifest import AUTOSAVE_NAME
from iprt.scene.object_edits import ObjectEdit, flat
from iprt.scene.scene import Scene
from iprt.scene.scene_files import fingerprint
from iprt.viewer.scene_snapshot import EditedScene
from tests.clips import write_clip
from tests.scene.files import CUBE


def edited(scene: Scene, *edits: ObjectEdit, light: LightEdit = UNEDITED) -> EditedScene:
    return EditedScene(scene, (scene.root / "scene.toml").read_text(), edits, light)


def written(
    scene: EditedScene,
    folder: Path,
    view: str | None = "ahead",
    shown: tuple[str, ...] | None = None,
) -> Scene:
    scene.write(folder, view, shown)
    return Scene.open(folder, allow_outside=True)


def placed(x: float) -> tuple[float, ...]:
    to_world = np.diag([0.3, 0.3, 0.3, 1.0])
    to_world[:3, 3] = x, -1.0, -1.6
    return flat(to_world)


def test_it_is_the_scene_as_saved(tmp_path: Path) -> None:
    """Also to a video that goes on. Nothing is written to the scene, not even by links."""
    scene = Scene.open(write_clip(tmp_path / "clip", 2))
    edits, light = (ObjectEdit("cube", placed(0.5)),), LightEdit(gloss="declared")
    (scene.root / AUTOSAVE_NAME).mkdir()
    before = {path: path.stat().st_mtime_ns for path in scene.root.iterdir()}
    snapshot = written(edited(scene, *edits, light=light), tmp_path / "copy")
    assert {path: path.stat().st_mtime_ns for path in scene.root.iterdir()} == before
    assert not (tmp_path / "copy" / "scene.toml").is_symlink()
    assert not (tmp_path / "copy" / AUTOSAVE_NAME).exists()
    save_edits(scene, edits, light=light)
    saved = Scene.open(scene.root)
    assert snapshot.manifest == saved.manifest
    assert fingerprint(snapshot) == fingerprint(saved)


def test_added_meshes_and_hidden_objects(tmp_path: Path) -> None:
    folder = write_clip(tmp_path / "clip", 1)
    (folder / "meshes").mkdir()
    (folder / "meshes" / "other.obj").write_text(CUBE)
    text = (folder / "scene.toml").read_text()
    (folder / "scene.toml").write_text(text + 'objects = ["cube"]\n')
    mesh = tmp_path / "ball.obj"
    mesh.write_text(CUBE)
    scene = Scene.open(folder)
    new = edited(scene, ObjectEdit("ball", placed(0.0), path=mesh))
    names = ("cube", "ball")
    for number, (view, shown, objects, listed) in enumerate(
        (
            ("ahead", names, names, names),
            ("ahead", None, names, names),
            ("ahead", ("ball", "nobody"), ("ball",), ("ball",)),
            (None, ("cube",), ("cube",), ("cube",)),
            (None, (), (), ()),
        )
    ):
        found = written(new, tmp_path / f"copy{number}", view, shown)
        assert tuple(table.name for table in found.manifest.objects) == objects
        assert found.views["ahead"].objects == listed
    first, again = tmp_path / "copy0", tmp_path / "again"
    assert fingerprint(Scene.open(first, allow_outside=True)) == fingerprint(
        written(new, again, "ahead", names)
    )
    assert [path.name for path in (folder / "meshes").iterdir()] == ["other.obj"]


def test_objects_beyond_a_views_list(tmp_path: Path) -> None:
    """The user shows what the view does not."""
    folder = write_clip(tmp_path / "clip", 1)
    text = (folder / "scene.toml").read_text()
    (folder / "scene.toml").write_text(text + "objects = []\n")
    scene = written(edited(Scene.open(folder)), tmp_path / "copy", "ahead", ("cube",))
    assert scene.views["ahead"].objects == ("cube",)


def test_links_lead_where_the_scene_may_read(tmp_path: Path) -> None:
    folder = write_clip(tmp_path / "clip", 1)
    (tmp_path / "secret").touch()
    (folder / "outside").symlink_to(tmp_path / "secret")
    (folder / "inside").symlink_to(folder / "cube.obj")
    (folder / "loop").symlink_to(folder)
    (folder / "sub").mkdir()
    (folder / "sub" / "up").symlink_to(folder)
    usual = {"scene.toml", "color.0000.exr", "depth.exr", "cube.obj", "inside", "sub"}
    for allow, more in ((False, set()), (True, {"outside"})):
        copy = tmp_path / f"copy{allow}"
        written(edited(Scene.open(folder, allow_outside=allow)), copy)
        assert {str(path.relative_to(copy)) for path in copy.rglob("*")} == usual | more
