"""Edits written to scene.toml: what is read again is what was edited, and all else is as it was."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from iprt.errors import FormatError, SceneError
from iprt.geometry.material import Material, MaterialKind
from iprt.geometry.meshes import load_mesh
from iprt.scene.edit_writing import save_edits
from iprt.scene.manifest_writing import free_name
from iprt.scene.object_edits import ObjectEdit, edited_objects, flat, require_place
from iprt.scene.objects import AnyMesh, objects_at
from iprt.scene.scene import Scene
from tests.scene.files import CUBE, IDENTITY, MANIFEST, snapshot, write_rgb, write_scene

OBJECTS = f"""
# the first
[[objects]]
name = "tiles"  # on the floor
mesh = "cube.obj"
to_world = {IDENTITY}
material = {{ kind = "diffuse", albedo = [1, 1, 1], texture = "tiles.png" }}

[[objects]]
name = "plain"
mesh = "cube.obj"
to_world = {IDENTITY}

[[objects.keyframes]]
time = 1.0
scale = 2

[[objects]]
name = "last"  # stays
mesh = "cube.obj"
to_world = {IDENTITY}
"""
VIEWS = """
[[views]]
name = "all"
size = [32, 24]

[[views]]
name = "some"
size = [32, 24]
objects = [
  "plain",  # which goes
  "last",
]

[[views]]
name = "true"
size = [32, 24]
objects = ["last", "plain"]
truth = "truth.exr"
"""
PAINT = Material("conductor", (0.9, 0.8, 0.7), alpha=0.05)


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    folder = write_scene(tmp_path / "scene", MANIFEST + OBJECTS + VIEWS)
    tiles = np.random.default_rng(0).integers(0, 255, (3, 5, 3), np.uint8)
    Image.fromarray(tiles).save(folder / "tiles.png")
    write_rgb(folder / "truth.exr", np.ones((24, 32, 3), np.float32))
    return Scene.open(folder)


def placed(x: float) -> np.ndarray:
    turned = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    to_world = np.eye(4)
    to_world[:3, :3], to_world[:3, 3] = 0.31 * turned, (x, -1.1, 1 / 3)
    return to_world


def mesh_file(folder: Path, size: float, name: str = "thing.obj") -> Path:
    """A mesh whose name others have, too."""
    folder.mkdir()
    scaled = CUBE.replace("1 -1", f"{size} -1")
    (folder / name).write_text(scaled)
    return folder / name


def new_object(name: str, path: Path, x: float, material: Material | None = None) -> ObjectEdit:
    return ObjectEdit(name, flat(placed(x)), material, load_mesh(path), path)


def same_mesh(one: AnyMesh, other: AnyMesh) -> bool:
    arrays = ("positions", "normals", "uvs", "triangles", "material_index")
    return (
        all(np.array_equal(getattr(one, name), getattr(other, name)) for name in arrays)
        and one.materials == other.materials
        and all(
            np.array_equal(a.texture, b.texture)  # None equals None
            for a, b in zip(one.materials, other.materials, strict=True)
        )
    )


def test_what_is_read_again_is_what_was_edited(scene: Scene, tmp_path: Path) -> None:
    (tiles, *_) = scene.objects
    edits = (
        ObjectEdit(
            "tiles", flat(placed(0.5)), replace(tiles.bound.materials[0], albedo=(1, 0.5, 0))
        ),
        ObjectEdit("plain", removed=True),
        new_object("one", mesh_file(tmp_path / "one", 2), -0.5),
        new_object("two", mesh_file(tmp_path / "two", 3), -1.0, PAINT),
        new_object("three", tmp_path / "two" / "thing.obj", -1.5),
        new_object("here", scene.root / "cube.obj", 1.0),
    )
    before = scene.root / "scene.toml"
    lines = before.read_text().splitlines()
    save_edits(scene, edits)
    again = Scene.open(scene.root)
    for time in (0.0, 2.0):
        shown = objects_at(edited_objects(scene.objects, edits, scene.manifest.nits), time)
        read = objects_at(again.objects, time)
        assert [entry.name for entry in read] == ["tiles", "last", "one", "two", "three", "here"]
        for one, other in zip(shown, read, strict=True):
            np.testing.assert_allclose(other.to_world, one.to_world, rtol=1e-6, atol=1e-7)
            assert same_mesh(one.mesh, other.mesh), one.name
    assert not same_mesh(again.instances[2].mesh, again.instances[3].mesh)
    kept = [line for line in lines if "#" in line and "which goes" not in line]
    assert [line for line in kept if line not in before.read_text().splitlines()] == []


def test_views_show_what_is_new_but_where_the_truth_does_not(scene: Scene, tmp_path: Path) -> None:
    removed = ObjectEdit("plain", removed=True)
    save_edits(scene, (removed, new_object("new", mesh_file(tmp_path / "one", 2), 0.5)))
    views = Scene.open(scene.root).views
    shown = {name: view.objects for name, view in views.items()}
    assert shown == {
        "all": ("tiles", "last", "new"),
        "some": ("last", "new"),
        "true": ("last",),
    }


@pytest.mark.parametrize(
    ("edit", "marked"),
    [
        (ObjectEdit("last", flat(placed(0.5))), {"true", "whole"}),
        (ObjectEdit("plain", material=PAINT), {"true", "whole"}),
        (ObjectEdit("plain", removed=True), {"true", "whole"}),
        (ObjectEdit("tiles", flat(placed(0.5))), {"whole"}),
        (ObjectEdit("new", flat(placed(0.5)), path=Path("cube.obj")), {"whole"}),
        (ObjectEdit("new", flat(placed(0.5)), path=Path("cube.obj"), removed=True), set()),
        (ObjectEdit("last"), set()),
    ],
)
def test_truths_that_show_what_is_edited_are_outdated(
    scene: Scene, edit: ObjectEdit, marked: set[str]
) -> None:
    """Views without a list of objects show all of them, new ones included."""
    manifest = scene.root / "scene.toml"
    text = manifest.read_text() + '[[views]]\nname = "whole"\nsize = [32, 24]\n'
    text += 'truth = "truth.exr"  # of today\n'
    manifest.write_text(text)
    if edit.path is not None:
        edit = replace(edit, path=scene.root / edit.path)
    save_edits(Scene.open(scene.root), [edit])
    views = Scene.open(scene.root).views.values()
    assert {view.name for view in views if view.truth_outdated} == marked
    assert {view.name for view in views if view.truth_warning} == marked
    assert 'truth = "truth.exr"  # of today' in manifest.read_text()


def test_an_object_of_another_ones_texture(scene: Scene) -> None:
    texture = scene.objects[0].bound.materials[0].texture
    assert texture is not None
    save_edits(scene, [ObjectEdit("last", material=Material(texture=texture.copy()))])
    material = Scene.open(scene.root).objects[2].bound.materials[0]
    assert np.array_equal(material.texture, texture)


@pytest.mark.parametrize(
    "material",
    [
        Material("dielectric", (0.9, 1.0, 0.8), alpha=0.0, thin=True),
        Material("dielectric", (1.0, 1.0, 1.0), alpha=0.2, absorption=(3.0, 0.0, 1.0), priority=-2),
        Material("principled", (0.9, 1.0, 0.8), transmission=0.4, thin=True),
        Material("principled", (0.9, 1.0, 0.8), clearcoat=0.5, clearcoat_alpha=0.25),
        Material("principled", sheen=(0.5, 0.25, 0.0), sheen_alpha=0.125, tint=(1.0, 0.5, 0.25)),
    ],
)
def test_glass_and_covers_are_written(scene: Scene, material: Material) -> None:
    save_edits(scene, [ObjectEdit("last", material=material)])
    found = Scene.open(scene.root).objects[2].bound.materials
    assert found == (material,)


@pytest.mark.parametrize("kind", ["diffuse", "conductor", "plastic", "principled"])
def test_a_lamp_is_written(scene: Scene, kind: MaterialKind) -> None:
    lamp = Material(kind, (0.2, 0.3, 0.4), emission=(30.0, 0.0, 1.5))
    save_edits(scene, [ObjectEdit("last", material=lamp)])
    assert Scene.open(scene.root).objects[2].bound.materials == (lamp,)


def test_what_cannot_be_written_changes_nothing(scene: Scene, tmp_path: Path) -> None:
    gone = new_object("gone", mesh_file(tmp_path / "gone", 2), 0.5)
    shutil.rmtree(tmp_path / "gone")
    flattened = np.diag([1.0, 1.0, 0.0, 1.0])
    before = snapshot(scene.root)
    for edit, problem in (
        (ObjectEdit("last", flat(flattened)), "singular"),
        (gone, "no such mesh file"),
    ):
        good = new_object("good", mesh_file(tmp_path / problem, 2), 0.5)
        with pytest.raises((SceneError, FormatError), match=problem) as caught:
            save_edits(scene, (good, edit))
        assert "\n" not in str(caught.value)
        assert snapshot(scene.root) == before


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("format = 1", "format = "),
        ('name = "plain"', 'nam = "plain"'),
        ("[[objects]]", "[objects]"),
    ],
)
def test_a_file_that_somebody_broke_meanwhile(scene: Scene, old: str, new: str) -> None:
    """The error names it, and it stays as it is."""
    path = scene.root / "scene.toml"
    broken = path.read_text().replace(old, new)
    path.write_text(broken)
    with pytest.raises(SceneError, match=r"scene\.toml"):
        save_edits(scene, [ObjectEdit("last", removed=True)])
    assert path.read_text() == broken


@pytest.mark.parametrize("x", [np.nan, np.inf, 1e30])
def test_nothing_is_put_where_it_cannot_be(x: float) -> None:
    require_place("thing", placed(2.0))
    with pytest.raises(SceneError, match="thing cannot be put there"):
        require_place("thing", placed(x))
    with pytest.raises(SceneError, match="flattens"):
        require_place("thing", np.diag([1.0, 0.0, 1.0, 1.0]))


def test_edits_tell_of_textures(scene: Scene) -> None:
    """To take one away is an edit, although materials are compared without."""
    textured = scene.objects[0].bound.materials[0]
    plain = replace(textured, texture=None)
    assert ObjectEdit("tiles", material=textured) != ObjectEdit("tiles", material=plain)
    save_edits(scene, [replace(ObjectEdit("tiles", material=textured), material=plain)])
    assert Scene.open(scene.root).objects[0].bound.materials[0].texture is None


def test_names_of_files_that_are_none(scene: Scene, tmp_path: Path) -> None:
    """What is added from them can be saved."""
    name = free_name("  ", set())
    save_edits(scene, [new_object(name, mesh_file(tmp_path / "new", 1.0, "  .obj"), 1.0)])
    assert Scene.open(scene.root).objects[-1].name == name
