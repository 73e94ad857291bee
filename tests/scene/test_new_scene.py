"""`iprt scene`: own footage in two commands, and reports that say what is wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from tyro.extras import SubcommandApp

from iprt.commands import scene as commands
from iprt.errors import FormatError, SceneError
from iprt.footage.video.depth_code import DepthCode
from iprt.geometry.material import Material
from iprt.scene.mesh_pose import MeshPose
from iprt.scene.new_object import add_object, parse_material
from iprt.scene.new_scene import new_scene
from iprt.scene.scene import Scene
from iprt.scene.shapes import SHAPES
from tests.scene.files import (
    CUBE,
    HIGH,
    LOW,
    MANIFEST,
    OBJECT,
    VIEW,
    box_room,
    snapshot,
    write_channels,
    write_png16_grey,
    write_rgb,
    write_scene,
)


def run(*words: str) -> None:
    app = SubcommandApp()
    for name in ("info", "check", "new", "add"):
        app.command(name=name)(getattr(commands, name))
    app.cli(args=list(words))


@pytest.fixture
def footage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A photograph (8-bit) and depth (16-bit, millimetres) of the box room, and a cube."""
    monkeypatch.setattr("iprt.scene.real_materials.MIN_HEIGHT", 129)  # gloss is not looked for
    folder = tmp_path / "footage"
    folder.mkdir()
    depth, _ = box_room(256, 128)
    Image.new("RGB", (256, 128), (99, 120, 140)).save(folder / "photo.PNG")
    write_png16_grey(folder / "depth.png", np.rint(depth * 1000).astype(np.uint16))
    (folder / "cube.obj").write_text(CUBE)
    return folder


def make(tmp_path: Path, footage: Path) -> Path:
    new_scene(
        tmp_path / "own", footage / "photo.PNG", footage / "depth.png", DepthCode(0.001), None
    )
    return tmp_path / "own"


def vertices(scene: Scene, name: str) -> Any:
    (instance,) = scene.instances_named((name,))
    matrix = instance.to_world
    return instance.mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]


@pytest.mark.thorough
def test_own_footage_takes_two_commands(
    tmp_path: Path, footage: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = str(tmp_path / "own")
    photo, depth = str(footage / "photo.PNG"), str(footage / "depth.png")
    run("new", own, "--color", photo, "--depth", depth, "--depth-scale", "0.001")
    words = ("--look", "-20", "-50", "--height", "0.3", "--material", "plastic:0.5,0.1,0.1:0.2")
    run("add", own, str(footage / "cube.obj"), *words)
    assert "--view cube -o cube.png" in capsys.readouterr().out
    scene = Scene.open(Path(own))
    assert list(scene.views) == ["ahead", "cube"]
    (material,) = scene.instances[0].mesh.materials
    assert (material.kind, material.alpha) == ("plastic", 0.2)
    corners = vertices(scene, "cube")
    assert corners[:, 1].min() == pytest.approx(LOW[1], abs=5e-3)
    assert np.ptp(corners[:, 1]) == pytest.approx(0.3, abs=1e-4)
    center = corners.mean(axis=0)
    assert np.degrees(np.arctan2(center[0], -center[2])) == pytest.approx(-20, abs=1)
    # The view's centre is the object's.
    view = scene.views["cube"].view
    assert view.project(center) == pytest.approx([view.width / 2, view.height / 2], abs=1)
    pixels = view.project(corners.astype(np.float64))
    assert ((pixels > 0) & (pixels < (view.width, view.height))).all()
    run("check", own)
    assert "fine" in capsys.readouterr().out


@pytest.mark.thorough
@pytest.mark.parametrize("look", [(0, -20), (90, 10), (180, 0), (-60, -30), (40, -24), (-33, -10)])
def test_objects_stand_on_the_floor_and_cut_no_wall(
    tmp_path: Path, footage: Path, look: tuple[float, float]
) -> None:
    own = make(tmp_path, footage)
    add_object(own, footage / "cube.obj", *look, pose=MeshPose(height_m=0.5))
    corners = vertices(Scene.open(own), "cube")
    assert corners[:, 1].min() == pytest.approx(LOW[1], abs=0.01)
    assert (corners > LOW - 0.02).all()
    assert (corners < HIGH + 0.02).all()


def test_default_height_follows_the_distance(tmp_path: Path, footage: Path) -> None:
    own = make(tmp_path, footage)
    add_object(own, footage / "cube.obj", 0, -45)
    distance = -LOW[1] * np.sqrt(2)
    height = np.ptp(vertices(Scene.open(own), "cube")[:, 1])
    assert height == pytest.approx(0.2 * distance, rel=0.02)


def test_adding_keeps_comments_and_what_was_there(tmp_path: Path) -> None:
    text = "# my scene\n" + MANIFEST + "# the cube\n" + OBJECT + VIEW + "# the end\n"
    folder = write_scene(tmp_path / "s", text)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "cube.obj").write_text(CUBE)
    added = add_object(folder, tmp_path / "other" / "cube.obj", 0, -45)
    assert added.name == "cube-2"
    assert (folder / "scene.toml").read_text().startswith(text.rstrip("\n"))
    scene = Scene.open(folder)
    assert [table.name for table in scene.manifest.objects] == ["cube", "cube-2"]
    assert scene.views["cube-2"].objects == ("cube-2",)


@pytest.mark.parametrize("objects", ["", 'objects = ["cube"]\n'])
def test_adding_outdates_truths_that_would_show_the_object(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], objects: str
) -> None:
    """Where a view lists its objects, new ones are not among them."""
    text = MANIFEST + OBJECT + VIEW + objects + 'truth = "truth.exr"\n'
    folder = write_scene(tmp_path / "s", text)
    write_rgb(folder / "truth.exr", np.ones((24, 32, 3), np.float32))
    add_object(folder, folder / "cube.obj", 0, -45)
    assert Scene.open(folder).views["ahead"].truth_outdated == (not objects)
    run("check", str(folder))
    assert ("views.ahead.truth: objects have been edited" in capsys.readouterr().out) == (
        not objects
    )


def test_meshes_of_one_name_do_not_overwrite_each_other(tmp_path: Path, footage: Path) -> None:
    own = make(tmp_path, footage)
    add_object(own, footage / "cube.obj", 0, -45)
    (footage / "cube.obj").write_text(CUBE.replace("v 1 1 1", "v 2 2 2"))
    add_object(own, footage / "cube.obj", 90, -45)
    meshes = [table.mesh for table in Scene.open(own).manifest.objects]
    assert meshes == ["meshes/cube.obj", "meshes/cube-2.obj"]
    assert (own / "meshes/cube.obj").read_text() == CUBE


def test_textures_travel_with_the_mesh(tmp_path: Path, footage: Path) -> None:
    Image.new("RGB", (2, 2), (255, 0, 0)).save(footage / "t.png")
    (footage / "m.mtl").write_text("newmtl a\nKd 1 1 1\nmap_Kd t.png\n")
    (footage / "cube.obj").write_text("mtllib m.mtl\nusemtl a\n" + CUBE)
    own = make(tmp_path, footage)
    add_object(own, footage / "cube.obj", 0, -45)
    (material,) = Scene.open(own).instances[0].mesh.materials
    assert material.texture is not None


def test_inline_objects_cannot_be_extended_but_stay_whole(tmp_path: Path) -> None:
    folder = write_scene(tmp_path / "s", "objects = []\n" + MANIFEST)
    before = snapshot(folder)
    with pytest.raises(SceneError, match=r"as \[\[objects\]\], \[\[real_materials\]\]"):
        add_object(folder, folder / "cube.obj", 0, -45)
    assert snapshot(folder) == before


@pytest.mark.parametrize(
    ("color", "message"),
    [
        ("cube.obj", "not an EXR, PNG, JPEG"),
        ("c.%04d.png", "no file matches this pattern"),
    ],
)
def test_failing_to_make_a_scene_leaves_no_folder(
    tmp_path: Path, footage: Path, color: str, message: str
) -> None:
    with pytest.raises(FormatError, match=message):
        new_scene(tmp_path / "own", footage / color, footage / "depth.png", DepthCode(0.001), None)
    assert not (tmp_path / "own").exists()


def test_new_makes_a_scene_of_a_video(tmp_path: Path) -> None:
    depth, _ = box_room(32, 16)
    for index in (5, 6):
        write_rgb(tmp_path / f"c{index:03d}.exr", np.full((16, 32, 3), index, np.float32))
    write_channels(tmp_path / "d.exr", Z=depth.astype(np.float32))
    own = tmp_path / "own"
    assert new_scene(own, tmp_path / "c%03d.exr", tmp_path / "d.exr", DepthCode(), None) == 2
    scene = Scene.open(own)
    assert list(scene.frame_indices) == [5, 6]
    assert scene.frame(6).color[0, 0, 0] == 6


def test_info_says_what_matters(
    tmp_path: Path, footage: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = make(tmp_path, footage)
    add_object(own, footage / "cube.obj", 0, -45, material=parse_material("mirror"))
    run("info", str(own), "--thumbnail", str(tmp_path / "t.png"))
    text = capsys.readouterr().out
    for part in (
        "256 x 128",
        "0.001 m per stored unit",
        "half below 1.",
        "% of all light",
        "12 triangles, mirror",
    ):
        assert part in text
    assert Image.open(tmp_path / "t.png").size == (1024, 512)
    run("info", str(own), "--json")
    record = json.loads(capsys.readouterr().out)
    depth, _ = box_room(256, 128)
    assert record["depth_percentiles"]["p50"] == pytest.approx(np.median(depth), abs=2e-3)
    assert record["objects"][0]["triangles"] == 12
    assert record["holes"] == {"area": 0.0, "flux": 0.0}
    assert set(record["renderer"]) == {"ahead", "cube"}


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("offset", "warning"),
    [
        ((0.0, 0.2, 0.0), "floats 20.0 cm above"),
        ((0.0, -0.1, 0.0), "sinks 10.0 cm into"),
        ((0.0, 0.0, -4.0), "outside the room"),
    ],
)
def test_check_warns_of_objects_badly_placed(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    offset: tuple[float, float, float],
    warning: str,
) -> None:
    x, y, z = np.array([0.2, LOW[1] + 0.2, -1.5]) + offset
    matrix = f"[0.2,0,0,{x}, 0,0.2,0,{y}, 0,0,0.2,{z}, 0,0,0,1]"
    text = MANIFEST + f'[[objects]]\nname = "cube"\nmesh = "cube.obj"\nto_world = {matrix}\n'
    run("check", str(write_scene(tmp_path / "s", text, width=512)))
    assert warning in capsys.readouterr().out


def test_check_names_every_problem_in_every_frame(tmp_path: Path) -> None:
    text = MANIFEST.replace("color.exr", "c%d.exr") + "frames = [0, 2]\n" + OBJECT + VIEW
    text += 'truth = "t.exr"\n'
    folder = write_scene(tmp_path / "s", text)
    color = (folder / "color.exr").read_bytes()
    for index, data in enumerate((color, color[: len(color) // 2], color)):
        (folder / f"c{index}.exr").write_bytes(data)
    write_rgb(folder / "t.exr", np.zeros((8, 8, 3), np.float32))
    (folder / "cube.obj").write_text("v 0 0 0\n")
    with pytest.raises(SceneError) as error:
        run("check", str(folder))
    message = str(error.value)
    assert "3 problems" in message
    for part in ("c1.exr: cut off", "cube.obj", "views.ahead.truth: t.exr has 8 x 8"):
        assert part in message


def test_check_names_what_was_not_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_scene(tmp_path / "s")
    (folder / "cube.obj").write_text(CUBE + "l 1 2\n")
    run("check", str(folder))
    assert "note: cube: not read from its file: lines" in capsys.readouterr().out


@pytest.mark.parametrize("shape", list(SHAPES))
def test_a_shape_needs_no_file(tmp_path: Path, footage: Path, shape: str) -> None:
    own = make(tmp_path, footage)
    run("add", str(own), shape, "--look", "0", "-45", "--height", "0.5", "--name", "thing")
    (thing,) = Scene.open(own).objects
    mesh = thing.bound
    size = np.ptp(mesh.positions, axis=0)
    np.testing.assert_allclose(size, (1.0, 0.0 if shape == "square" else 1.0, 1.0), atol=0.01)
    # Normals point outward, and up on the square.
    normals = mesh.normals[mesh.triangles].mean(axis=1)
    outward = mesh.positions[mesh.triangles].mean(axis=1) + np.array([0.0, 1e-3, 0.0])
    assert ((normals * outward).sum(axis=1) > 0.0).all()


def test_a_lamp(tmp_path: Path, footage: Path) -> None:
    own = make(tmp_path, footage)
    add_object(own, footage / "cube.obj", 0, -45, material=parse_material("lamp:30,22.5,14"))
    (cube,) = Scene.open(own).objects
    (material,) = cube.bound.materials
    assert (material.kind, material.emission) == ("diffuse", (30.0, 22.5, 14.0))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("glass", Material("dielectric", (1.0, 1.0, 1.0), alpha=0.0)),
        ("glass:0.9,1,0.8:0.3", Material("dielectric", (0.9, 1.0, 0.8), alpha=0.3)),
        ("pane", Material("dielectric", (1.0, 1.0, 1.0), alpha=0.0, thin=True)),
    ],
)
def test_glass(tmp_path: Path, footage: Path, text: str, expected: Material) -> None:
    own = make(tmp_path, footage)
    add_object(own, footage / "cube.obj", 0, -45, material=parse_material(text))
    (cube,) = Scene.open(own).objects
    assert cube.bound.materials == (expected,)


@pytest.mark.parametrize(
    "text", ["", "glas:1,1,1", "glass:1,1", "pane:1,1,2", "glass:1,1,1:0:0",
             "diffuse", "diffuse:1,1", "diffuse:1,1,2", "diffuse:1,1,1:0.1",
             "plastic:0,0,0:nan", "plastic:0,0,0:2", "conductor:a,b,c", "mirror:1",
             "lamp:1,1,1:0.1", "lamp:-1,0,0", "lamp:1e9,1,1"],
)  # fmt: skip
def test_materials_that_make_no_sense(text: str) -> None:
    with pytest.raises(SceneError, match="--material"):
        parse_material(text)
