"""Edits that are kept beside a scene, and read again: they are the same edits."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from iprt.errors import FormatError, SceneError
from iprt.files.toml_text import MAX_BYTES
from iprt.footage.video.video_table import SunTable
from iprt.geometry.keyframes import ObjectKeyframe
from iprt.geometry.material import Material
from iprt.geometry.meshes import load_mesh
from iprt.scene.autosave import EDITS, Autosave, Found, left
from iprt.scene.edit_reading import light_edit, object_edits, table_edits
from iprt.scene.edit_writing import NewFiles, edited_text, save_edits
from iprt.scene.light_edits import UNEDITED, LightEdit
from iprt.scene.light_tables import PointTable
from iprt.scene.manifest import AUTOSAVE_NAME, manifest_text
from iprt.scene.object_edits import ObjectEdit, edited_objects, flat
from iprt.scene.scene import Scene
from tests.scene.files import MANIFEST, write_scene
from tests.scene.test_object_edits import OBJECTS, VIEWS, mesh_file, placed, same_mesh

LAMP = """
[[objects]]
name = "lamp"
light = { kind = "point", power = 2.0 }
to_world = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -2, 0, 0, 0, 1]
group = "lights"
"""
NAMES = ("tiles", "plain", "last", "lamp")
SUN = SunTable(direction=[0.0, 0.6, 0.8], irradiance=[2.0, 2.0, 1.5], angle_deg=0.5)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    folder = tmp_path_factory.mktemp("kept")
    mesh_file(folder / "elsewhere", 2)
    views = VIEWS.replace('truth = "truth.exr"\n', "")
    write_scene(
        folder / "scene", MANIFEST + OBJECTS.replace(', texture = "tiles.png"', "") + LAMP + views
    )
    return Scene.open(folder / "scene")


def keep(scene: Scene, edits: tuple[ObjectEdit, ...], light: LightEdit = UNEDITED) -> Path:
    """Keep edits as a viewer does that is killed then; its folder."""
    autosave = Autosave.new(scene.root)
    new = NewFiles(scene, autosave.folder)
    base = manifest_text(scene.root / "scene.toml")
    text = edited_text(new, edits, light, base)
    with new.sources() as copies:
        autosave.copy(copies)
    autosave.write(base, text)
    autosave._lock.close()
    return autosave.folder


def restored(scene: Scene, folder: Path) -> tuple[tuple[ObjectEdit, ...], LightEdit]:
    found, now = Found.read(folder), scene.manifest
    edits = object_edits(scene, table_edits(scene.root, found.before, found.after, now))
    return edits, light_edit(found.before, found.after, now)


KEYS = (
    ObjectKeyframe(time=0.0, translation=[0.1, 0.2, 0.3]),
    ObjectKeyframe(time=1.5, scale=2.0, interpolation="smooth"),
)
colors = st.tuples(*[st.floats(0.0, 1.0)] * 3)
shiny = st.builds(
    Material, st.sampled_from(["plastic", "conductor"]), colors, alpha=st.floats(0.0, 1.0)
)
materials = shiny | st.builds(Material, st.just("diffuse"), colors)
values = {
    "to_world": st.floats(-2.0, 2.0).map(lambda x: flat(placed(x))),
    "group": st.sampled_from(["", "one"]),
    "locked": st.booleans(),
    "keyframes": st.sampled_from([(), KEYS]),
}
lights = st.builds(PointTable, kind=st.just("point"), power=st.floats(0.1, 9.0))


@st.composite
def edits(draw: st.DrawFn, elsewhere: Path) -> tuple[ObjectEdit, ...]:
    """What a user may do to the objects of the scene."""

    def parts(*, lamp: bool, new: bool = False) -> dict[str, object]:
        last = {"light": lights} if lamp else {"material": materials}
        own = {key: draw(st.none() | some) for key, some in (values | last).items()}
        return own | {"to_world": draw(values["to_world"])} if new else own

    found = []
    for name in NAMES:
        lamp = name == "lamp"
        kind = draw(st.sampled_from(["keep", "edit", "remove", "rename", "copy"]))
        if kind == "edit":
            found.append(ObjectEdit(name, **parts(lamp=lamp)))
        if kind in ("remove", "rename"):
            found.append(ObjectEdit(name, removed=True))
        if kind in ("rename", "copy"):
            found.append(ObjectEdit(f"{name}-2", copy_of=name, **parts(lamp=lamp)))
    if draw(st.booleans()):
        path = elsewhere / "thing.obj"
        mesh = {"path": path, "mesh": load_mesh(path)}
        found += [ObjectEdit(f"new{n}", **mesh, **parts(lamp=False, new=True)) for n in (1, 2)]
    if draw(st.booleans()):
        given = parts(lamp=True, new=True) | {"light": draw(lights)}
        found.append(ObjectEdit("shine", **given))
    return tuple(found)


@settings(
    max_examples=30,
    derandomize=True,
    deadline=None,
)
@given(data=st.data())
def test_what_is_restored_is_what_was_edited(scene: Scene, data: st.DataObject) -> None:
    """Objects, their places, materials, names, groups and locks, and light."""
    made = data.draw(edits(scene.root.parent / "elsewhere"))
    light = LightEdit(
        gloss=data.draw(st.sampled_from([None, "declared"])),
        sun=data.draw(st.sampled_from([None, "none", SUN])),
        sky=data.draw(st.sampled_from([None, "none"])),
    )
    again, lit = restored(scene, keep(scene, made, light))
    video = scene.manifest.video
    assert lit.applied(video) == light.applied(video)
    nits = scene.manifest.nits
    one, other = (edited_objects(scene.objects, some, nits) for some in (made, again))
    assert [entry.name for entry in other] == [entry.name for entry in one]
    for a, b in zip(one, other, strict=True):
        for time_s in (0.0, 2.0):
            places = (entry.motion.at(time_s) for entry in (b, a))
            np.testing.assert_allclose(*places, rtol=1e-6, atol=1e-7)
        assert same_mesh(a.bound, b.bound), a.name
        assert (b.light, b.group, b.locked) == (a.light, a.group, a.locked)


@pytest.fixture
def own(tmp_path: Path) -> Scene:
    """A scene that the test changes."""
    return Scene.open(
        write_scene(tmp_path / "scene", MANIFEST + OBJECTS.replace(', texture = "tiles.png"', ""))
    )


def changed(scene: Scene, change: Callable[[str], str]) -> Scene:
    """The scene after another program has changed its text."""
    path = scene.root / "scene.toml"
    path.write_text(change(path.read_text()))
    return Scene.open(scene.root)


PAINT = ObjectEdit("last", material=Material("plastic", (0.2, 0.3, 0.4), alpha=0.5))


def test_edits_are_those_of_the_scene_as_others_left_it(own: Scene, tmp_path: Path) -> None:
    """Also where a merge of the texts is impossible; what it has by now is no edit."""
    path = mesh_file(tmp_path / "other", 3)
    new = ObjectEdit("thing", flat(placed(0.5)), None, load_mesh(path), path)
    folder = keep(own, (PAINT, new))
    now = changed(own, lambda text: text.replace('name = "last"', 'locked = true\nname = "last"'))
    found, _ = restored(now, folder)
    assert found == (PAINT, replace(new, to_world=found[1].to_world, path=found[1].path))
    save_edits(now, found)
    assert not (now.root / now_mesh(now)).is_relative_to(folder), "it stays when the folder goes"
    now = Scene.open(now.root)
    assert restored(now, folder)[0] == ()
    assert [table.locked for table in now.manifest.objects] == [False, False, True, False]
    with pytest.raises(SceneError, match=r"last: scene\.toml no longer has the object") as told:
        restored(changed(now, lambda text: text.replace('"last"', '"first"')), folder)
    assert "\n" not in str(told.value)


def now_mesh(scene: Scene) -> str:
    """The mesh of the newest object."""
    name = Scene.open(scene.root).manifest.objects[-1].mesh
    assert name is not None
    return name


def test_maps_are_kept_with_the_edits(own: Scene) -> None:
    image = np.random.default_rng(1).integers(0, 255, (4, 8, 1)).astype(np.float32) / 255.0
    painted = Material(texture=np.broadcast_to(image, (4, 8, 3)).astype(np.float32))
    folder = keep(own, (ObjectEdit("last", material=painted),))
    assert Scene.open(own.root).manifest == own.manifest
    assert not (own.root / "textures").exists()
    (edit,), _ = restored(own, folder)
    assert edit.material is not None
    assert edit.material.texture is not None
    np.testing.assert_allclose(edit.material.texture, image.repeat(3, axis=2), atol=0.01)


def test_folders_of_viewers_that_live_are_left_alone(own: Scene) -> None:
    alive, dead = Autosave.new(own.root), keep(own, (PAINT,))
    alive.write("", "")
    older = keep(own, (PAINT,))
    os.utime(older / EDITS, (1, 1))
    rubbish = Autosave.new(own.root)
    rubbish._lock.close()
    assert left(own.root) == [dead, older]
    assert not rubbish.folder.exists()
    alive.forget()
    alive.close()
    assert left(own.root) == [dead, older]
    assert not alive.folder.exists()


def test_a_full_disk_leaves_the_edits_before(own: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = keep(own, (PAINT,))

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    autosave = Autosave(folder)
    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(FormatError, match=r"edits\.json: cannot be written: No space left"):
        autosave.write("", "")
    monkeypatch.undo()
    autosave.close()
    assert restored(own, folder)[0] == (PAINT,)
    assert sorted(path.name for path in folder.iterdir()) == [EDITS]


def texts(base: str, text: str) -> str:
    return json.dumps({"format": 1, "base": base, "text": text})


OUTSIDE = 'name = "spy"\nmesh = "link.obj"\nto_world = [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n'


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (lambda text: "", "is damaged: json_invalid"),
        (lambda text: texts(text, text)[:-20], "is damaged: json_invalid"),
        (lambda text: '{"format": 2}', "is damaged"),
        (
            lambda text: texts(text, text)[:-1] + ', "code": "x"}',
            "is damaged: extra_forbidden",
        ),
        (lambda text: "[" * 100_000, "is damaged"),
        (lambda text: texts(text, "\x1b[31m = ["), "is damaged: edits.json: not valid TOML"),
        (lambda text: texts(text, text.replace("cube.obj", "../x.obj")), "is damaged"),
        (lambda text: texts(text, f"{text}\n[[objects]]\n{OUTSIDE}"), "link.obj: is a link to"),
        (lambda text: " " * (9 * MAX_BYTES), "bytes; at most"),
    ],
)
def test_damaged_and_hostile_folders(own: Scene, content: Callable[[str], str], told: str) -> None:
    """One line says what is wrong, and nothing outside is read."""
    (own.root / "link.obj").symlink_to("/etc/passwd")
    folder = own.root / AUTOSAVE_NAME / "host-1-1"
    folder.mkdir(parents=True)
    (folder / EDITS).write_text(content((own.root / "scene.toml").read_text()))
    assert left(own.root) == [folder]
    with pytest.raises(FormatError) as error:
        restored(own, folder)
    assert told in str(error.value)
    assert str(error.value).isprintable()


def test_links_are_not_followed(own: Scene, tmp_path: Path) -> None:
    folder = keep(own, (PAINT,))
    elsewhere = tmp_path / "elsewhere"
    (own.root / AUTOSAVE_NAME).rename(elsewhere)
    (own.root / AUTOSAVE_NAME).symlink_to(elsewhere)
    before = sorted(path.name for path in elsewhere.rglob("*"))
    assert left(own.root) == []
    with pytest.raises(FormatError, match="a link leads there; delete it"):
        Autosave.new(own.root)
    (own.root / AUTOSAVE_NAME).unlink()
    (own.root / AUTOSAVE_NAME).mkdir()
    folder.symlink_to(elsewhere / folder.name)
    assert left(own.root) == []
    assert sorted(path.name for path in elsewhere.rglob("*")) == before
