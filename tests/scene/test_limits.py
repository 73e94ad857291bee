"""Limits on many files together, and what is shared so that they are not reached in vain."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from iprt.errors import FormatError
from iprt.files import safe_reading
from iprt.files.images import read_color
from iprt.footage.video.source import FrameSource
from iprt.geometry import mesh_files, mesh_shapes, textures
from iprt.geometry.meshes import load_mesh
from iprt.scene import objects as objects_module
from iprt.scene import real_materials
from iprt.scene.scene import Scene
from tests.scene.files import CUBE, IDENTITY, MANIFEST, write_scene

COLORS = {"red": (255, 0, 0), "green": (0, 255, 0)}


def obj_with_textures(folder: Path, names: list[str]) -> Path:
    """A cube whose faces have a material each, with textures of 8 x 8 by their names."""
    for name, color in COLORS.items():
        Image.new("RGB", (8, 8), color).save(folder / f"{name}.png")
    materials = [f"newmtl m{i}\nmap_Kd {name}.png\n" for i, name in enumerate(names)]
    (folder / "m.mtl").write_text("".join(materials))
    faces = [f"usemtl m{i}\nf 1 2 {3 + i}\n" for i in range(len(names))]
    (folder / "m.obj").write_text("mtllib m.mtl\n" + CUBE.partition("f ")[0] + "".join(faces))
    return folder / "m.obj"


def test_a_texture_of_many_materials_is_kept_once(tmp_path: Path) -> None:
    mesh = load_mesh(obj_with_textures(tmp_path, ["red", "green", "red", "red"]))
    textures = {id(m.texture): m.texture for m in mesh.materials if m.texture is not None}
    assert len(mesh.materials) == 4
    assert len(textures) == 2
    first_texels = sorted(tuple(texture[0, 0]) for texture in textures.values())
    assert first_texels == [(0.0, 1.0, 0.0), (1.0, 0.0, 0.0)]


def test_textures_of_a_mesh_count_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = obj_with_textures(tmp_path, ["red", "green", "red"])
    monkeypatch.setattr(textures, "MAX_PIXELS", 128)
    load_mesh(path)
    monkeypatch.setattr(textures, "MAX_PIXELS", 127)
    with pytest.raises(FormatError, match="its textures have more than the 127 pixels"):
        load_mesh(path)


@pytest.mark.parametrize(("name", "least"), [("MAX_TRIANGLES", 12), ("MAX_VERTICES", 8)])
def test_meshes_up_to_the_limit(
    name: str, least: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "m.obj").write_text(CUBE)
    monkeypatch.setattr(mesh_shapes, name, least)
    load_mesh(tmp_path / "m.obj")
    monkeypatch.setattr(mesh_shapes, name, least - 1)
    with pytest.raises(FormatError, match="12 triangles and 8 vertices; at most"):
        load_mesh(tmp_path / "m.obj")


def test_materials_times_vertices(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = obj_with_textures(tmp_path, ["red", "green", "red"])
    monkeypatch.setattr(mesh_files, "MAX_MATERIALS_TIMES_VERTICES", 3 * 8)
    load_mesh(path)
    monkeypatch.setattr(mesh_files, "MAX_MATERIALS_TIMES_VERTICES", 3 * 8 - 1)
    with pytest.raises(FormatError, match="3 materials of 8 vertices"):
        load_mesh(path)


def test_pictures_up_to_the_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for suffix in ("png", "jpg"):
        Image.new("RGB", (9, 7)).save(tmp_path / f"c.{suffix}")
        for side, pixels in ((9, 63), (8, 63), (9, 62)):
            monkeypatch.setattr(safe_reading, "MAX_SIDE", side)
            monkeypatch.setattr(safe_reading, "MAX_PIXELS", pixels)
            if (side, pixels) == (9, 63):
                read_color(tmp_path / f"c.{suffix}")
                continue
            with pytest.raises(FormatError, match="claims 9 x 7 pixels; at most"):
                read_color(tmp_path / f"c.{suffix}")


def objects(count: int, material: str) -> str:
    return "".join(
        f'[[objects]]\nname = "{i}"\nmesh = "cube.obj"\nto_world = {IDENTITY}\n'
        f"material = {{ {material.format(i % 2)} }}\n"
        for i in range(count)
    )


def test_objects_share_what_is_the_same(tmp_path: Path) -> None:
    manifest = MANIFEST + objects(4, 'kind = "diffuse", albedo = [1, 1, 1], texture = "t{}.png"')
    folder = write_scene(tmp_path / "room", manifest)
    for number, color in enumerate(COLORS.values()):
        Image.new("RGB", (8, 8), color).save(folder / f"t{number}.png")
    found = [instance.mesh for instance in Scene.open(folder).instances]
    assert len({id(mesh.triangles) for mesh in found}) == 1
    assert len({id(mesh.materials[0].texture) for mesh in found}) == 2
    for number, mesh in enumerate(found):
        texture = mesh.materials[0].texture
        assert texture is not None
        assert tuple(texture[0, 0]) == ((1, 0, 0), (0, 1, 0))[number % 2]


def test_objects_of_a_scene_count_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    manifest = MANIFEST + objects(4, 'kind = "diffuse", albedo = [1, 1, 1], texture = "t{}.png"')
    folder = write_scene(tmp_path / "room", manifest)
    for number in range(2):
        Image.new("RGB", (8, 8)).save(folder / f"t{number}.png")
    for triangles, pixels, fits in ((12, 128, True), (11, 128, False), (12, 127, False)):
        monkeypatch.setattr(objects_module, "MAX_TRIANGLES", triangles)
        monkeypatch.setattr(objects_module, "MAX_PIXELS", pixels)
        scene = Scene.open(folder)
        if fits:
            assert len(scene.instances) == 4
            continue
        with pytest.raises(FormatError, match="its objects have 12 triangles"):
            assert scene.instances


def test_masks_of_a_scene_count_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = '[[real_materials]]\nname = "{}"\nkind = "plastic"\nmask = "t{}.png"\n'
    masks = "".join(entry.format(i, i % 2) for i in range(4))
    folder = write_scene(tmp_path / "room", MANIFEST + masks)
    for number in range(2):
        Image.new("L", (8, 4), 255).save(folder / f"t{number}.png")
    monkeypatch.setattr(real_materials, "MAX_PIXELS", 64)
    assert len(Scene.open(folder).real_materials) == 4
    monkeypatch.setattr(real_materials, "MAX_PIXELS", 63)
    with pytest.raises(FormatError, match="its masks have more than the 63 pixels"):
        assert Scene.open(folder).real_materials


def test_missing_frames_are_counted_up_to_a_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_scene(
        tmp_path / "room", MANIFEST.replace('"color.exr"', '"c.%d.exr"\nframes = [0, 9]')
    )
    for most, phrase in ((11, "9 more frames"), (5, "at least 4 more frames")):
        monkeypatch.setattr(FrameSource, "MAX_MISSING", most)
        with pytest.raises(Exception, match=rf"no file c\.0\.exr \(and {phrase}\)"):
            Scene.open(folder)


def test_a_scale_that_leaves_no_depth_is_an_error(tmp_path: Path) -> None:
    """In single precision, metres of 1e-60 are none."""
    manifest = MANIFEST.replace("depth =", "depth_scale = 1e-60\ndepth =")
    with pytest.raises(FormatError, match="no depth"):
        Scene.open(write_scene(tmp_path / "room", manifest)).frame()


def test_a_texture_with_a_name_behind_options_is_found(tmp_path: Path) -> None:
    """trimesh takes the options for a part of the name, and goes without the texture."""
    path = obj_with_textures(tmp_path, ["red"])
    (tmp_path / "m.mtl").write_text("newmtl m0\nmap_Kd -s 1 1 1 -o 0 0 0 green.png\n")
    texture = load_mesh(path).materials[0].texture
    assert texture is not None
    assert np.array_equal(texture[0, 0], [0.0, 1.0, 0.0])
