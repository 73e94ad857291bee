"""Opening scenes: what they offer, and what is wrong with their files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from iprt.errors import FormatError, SceneError
from iprt.footage.prepare.turn import turned_color, turned_geometry
from iprt.geometry.solids import SWELLING
from iprt.scene.scene import Scene
from tests.scene.files import (
    MANIFEST,
    OBJECT,
    SHARED,
    VIEW,
    box_room,
    directions,
    write_channels,
    write_png16_grey,
    write_rgb,
    write_scene,
)


def open_error(folder: Path, error_type: type[Exception] = SceneError) -> str:
    with pytest.raises(error_type) as error:
        Scene.open(folder).frame()
    return str(error.value)


def test_a_scene_opens_by_folder_or_file(tmp_path: Path) -> None:
    write_scene(tmp_path)
    for path in (tmp_path, tmp_path / "scene.toml"):
        scene = Scene.open(path)
        assert scene.name == "box"
        assert scene.root == tmp_path
        assert scene.source.size == (64, 32)
        assert list(scene.frame_indices) == [0]


def test_frame_is_the_room(tmp_path: Path) -> None:
    frame = Scene.open(write_scene(tmp_path)).frame()
    depth, _ = box_room(64, 32)
    assert np.allclose(frame.depth, depth, rtol=1e-6)
    assert (frame.color == 0.5).all()
    assert not frame.opening.any()
    assert np.allclose(np.linalg.norm(frame.fitted_normal, axis=-1), 1.0, atol=1e-5)


def test_views_and_objects(tmp_path: Path) -> None:
    manifest = MANIFEST + OBJECT + OBJECT.replace('"cube"', '"other"') + VIEW
    manifest += VIEW.replace("ahead", "one") + 'objects = ["other"]\ncuts = [[0, 0, 4, 4]]\n'
    scene = Scene.open(write_scene(tmp_path, manifest))
    assert scene.views["ahead"].objects == ("cube", "other")
    assert scene.views["one"].cuts == ((0, 0, 4, 4),)
    assert [i.name for i in scene.instances_of()] == ["cube", "other"]
    assert [i.name for i in scene.instances_of("one")] == ["other"]
    first, second = scene.instances
    assert first.mesh is second.mesh
    with pytest.raises(SceneError, match="no view is named 'two'; the views are: ahead, one"):
        scene.instances_of("two")


def test_material_of_the_manifest_replaces_the_files(tmp_path: Path) -> None:
    manifest = MANIFEST + OBJECT
    manifest += 'material = { kind = "diffuse", albedo = [1, 1, 0.5], texture = "t.png" }\n'
    write_scene(tmp_path, manifest)
    Image.new("RGB", (2, 2), (188, 188, 188)).save(tmp_path / "t.png")
    (material,) = Scene.open(tmp_path).instances[0].mesh.materials
    assert material.albedo == (1.0, 1.0, 0.5)
    assert material.texture is not None
    assert np.allclose(material.texture, 0.5, atol=3e-3)


@pytest.mark.parametrize("count", [1, 2])
def test_solids_grow_where_there_are_several(tmp_path: Path, count: int) -> None:
    """So that touching ones overlap."""
    entry = OBJECT + 'material = { kind = "dielectric", transmittance = [1, 1, 1] }\n'
    names = ["cube", "other"][:count]
    write_scene(tmp_path, MANIFEST + "".join(entry.replace('"cube"', f'"{n}"') for n in names))
    trimesh.creation.box().export(tmp_path / "cube.obj")
    meshes = [instance.mesh for instance in Scene.open(tmp_path).instances]
    half = 0.5 * (1.0 + 2.0 * SWELLING) if count > 1 else 0.5
    for mesh in meshes:
        np.testing.assert_allclose(np.abs(mesh.positions), half, rtol=1e-6)


def test_missing_files_are_all_named(tmp_path: Path) -> None:
    manifest = MANIFEST + OBJECT + VIEW + 'truth = "t.exr"\n'
    write_scene(tmp_path, manifest.replace("depth.exr", "d.exr").replace("cube.obj", "c.obj"))
    message = open_error(tmp_path)
    for line in (
        "video.depth: there is no file d.exr",
        "objects.cube.mesh: there is no file c.obj",
        "views.ahead.truth: there is no file t.exr",
    ):
        assert line in message
    assert "3 problems" in message


def test_missing_frames_are_counted(tmp_path: Path) -> None:
    manifest = MANIFEST.replace("color.exr", "c.%02d.exr") + "frames = [3, 6]\n"
    write_scene(tmp_path, manifest)
    (tmp_path / "color.exr").rename(tmp_path / "c.04.exr")
    assert "video.color: there is no file c.03.exr (and 2 more frames)" in open_error(tmp_path)


def test_no_manifest_says_how_to_make_one(tmp_path: Path) -> None:
    assert "no such file; `iprt scene new`" in open_error(tmp_path)


def test_frames_are_read_by_number(tmp_path: Path) -> None:
    manifest = MANIFEST.replace("color.exr", "c.%02d.exr") + "frames = [3, 4]\n"
    write_scene(tmp_path, manifest)
    for index in (3, 4):
        write_rgb(tmp_path / f"c.{index:02d}.exr", np.full((32, 64, 3), index, np.float32))
    scene = Scene.open(tmp_path)
    assert scene.frame().color[0, 0, 0] == 3
    assert scene.frame(4).color[0, 0, 0] == 4
    with pytest.raises(SceneError, match="no frame 5; the scene has 3 to 4"):
        scene.frame(5)


@pytest.mark.parametrize("size", [(1, 1), (1, 2), (3, 5), (3, 1), (128, 63)], ids=str)
def test_any_other_shape_is_refused(tmp_path: Path, size: tuple[int, int]) -> None:
    write_scene(tmp_path)
    write_rgb(tmp_path / "color.exr", np.ones((size[1], size[0], 3), np.float32))
    write_channels(tmp_path / "depth.exr", Z=np.ones((size[1], size[0]), np.float32))
    message = open_error(tmp_path, FormatError)
    assert f"color.exr: {size[0]} x {size[1]} pixels; an equirect panorama is twice" in message


def test_the_smallest_panorama_is_read(tmp_path: Path) -> None:
    write_scene(tmp_path)
    write_rgb(tmp_path / "color.exr", np.ones((1, 2, 3), np.float32))
    write_channels(tmp_path / "depth.exr", Z=np.array([[1.5, np.nan]], np.float32))
    frame = Scene.open(tmp_path).frame()
    assert (frame.width, frame.height) == (2, 1)
    assert np.isfinite(frame.color).all()
    assert np.isfinite(frame.fitted_normal).all()
    assert (frame.depth > 0.0).all()


def test_integer_depth_needs_a_scale(tmp_path: Path) -> None:
    depth, _ = box_room(64, 32)
    write_scene(tmp_path, MANIFEST.replace("depth.exr", "depth.png"))
    write_png16_grey(tmp_path / "depth.png", np.rint(depth * 1000).astype(np.uint16))
    assert "video.depth_scale: depth.png stores integers" in open_error(tmp_path)
    manifest = MANIFEST.replace("depth.exr", "depth.png") + "depth_scale = 0.001\n"
    (tmp_path / "scene.toml").write_text(manifest)
    assert np.allclose(Scene.open(tmp_path).frame().depth, depth, atol=6e-4)


def test_depth_scale_applies_to_floats_too(tmp_path: Path) -> None:
    write_scene(tmp_path, MANIFEST + "depth_scale = 2.5\n")
    assert np.allclose(Scene.open(tmp_path).frame().depth, 2.5 * box_room(64, 32)[0], rtol=1e-5)


@pytest.mark.parametrize("yaw", [0.0, 90.0, -45.0, 13.0, 360.0, -725.5])
def test_yaw_offset_turns_the_world_to_the_right(yaw: float) -> None:
    width, height = 128, 64
    w = directions(width, height)
    before = (w + 2.0).astype(np.float32), box_room(width, height)[0].astype(np.float32)
    color = turned_color(before[0], yaw)
    depth, normal = turned_geometry(before[1], w.astype(np.float32), yaw)
    angle = np.deg2rad(yaw)
    back = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    # What is now seen along w lay along `back @ w` before.
    assert np.abs(color - (w @ back.T + 2.0)).max() < 2e-3
    assert normal is not None
    texel = 2 * np.pi / width
    assert np.abs(normal - w).max() < 0.51 * texel
    shift = yaw / 360 * width
    if shift == round(shift):
        assert np.array_equal(depth, np.roll(before[1], int(shift), axis=1))
        assert np.array_equal(color, np.roll(before[0], int(shift), axis=1))
    assert set(depth.ravel()) == set(before[1].ravel()), "depth is never averaged"


def test_bad_values_are_cleaned(tmp_path: Path) -> None:
    write_scene(tmp_path)
    color = np.full((32, 64, 3), 0.5, np.float32)
    color[3, 4] = (np.nan, np.inf, -1)
    depth = box_room(64, 32)[0].astype(np.float32)
    depth[[5, 9, 20, 25], [1, 63, 30, 2]] = (np.nan, np.inf, -2, 0)
    write_rgb(tmp_path / "color.exr", color)
    write_channels(tmp_path / "depth.exr", Z=depth)
    frame = Scene.open(tmp_path).frame()
    assert np.isfinite(frame.color).all()
    assert (frame.color >= 0).all()
    assert np.isfinite(frame.depth).all()
    assert (frame.depth > 0).all()
    assert np.isfinite(frame.fitted_normal).all()


@pytest.mark.parametrize("name", ["livingroom", "hotel", "livingroom-video"])
def test_shared_scenes_open(name: str) -> None:
    if not (SHARED / name).is_dir():
        pytest.skip(f"the scene `{name}` is not beside the repository")
    scene = Scene.open(SHARED / name)
    assert scene.views
    assert all(instance.mesh.dropped == () for instance in scene.instances)


@pytest.mark.thorough
def test_living_room_openings_carry_most_of_the_light(monkeypatch: pytest.MonkeyPatch) -> None:
    if not (SHARED / "livingroom").is_dir():
        pytest.skip("the scene `livingroom` is not beside the repository")
    monkeypatch.setattr("iprt.scene.real_materials.MIN_HEIGHT", 2**20)  # gloss is not looked for
    frame = Scene.open(SHARED / "livingroom").frame()
    assert frame.opening.mean() == pytest.approx(0.0169, abs=2e-4)
    row = np.sin((np.arange(frame.height) + 0.5) / frame.height * np.pi)[:, None]
    flux = row * frame.color.mean(axis=-1)
    assert flux[frame.opening].sum() / flux.sum() == pytest.approx(0.73, abs=0.01)
    assert 1.5 < frame.depth[frame.opening].min() < frame.depth[frame.opening].max() < 5.0
