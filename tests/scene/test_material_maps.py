"""Maps of materials: named in scene.toml, written with edits, and read again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from PIL import Image

from iprt.errors import FormatError, IprtError
from iprt.geometry.material import Material, MaterialKind
from iprt.geometry.meshes import load_mesh
from iprt.scene.edit_writing import save_edits
from iprt.scene.material_maps import MAPS, NORMALS, MapName, read_map
from iprt.scene.object_edits import ObjectEdit, flat
from iprt.scene.scene import Scene
from tests.geometry.gltf_models import models, write_model
from tests.scene.files import IDENTITY, MANIFEST, snapshot, write_scene

rng = np.random.default_rng(8)
PIXELS = rng.integers(0, 256, (3, 5, 4), np.uint8)
OBJECT = f"""
[[objects]]
name = "cube"
mesh = "cube.obj"
to_world = {IDENTITY}
"""


def with_material(folder: Path, words: str) -> Path:
    text = MANIFEST + OBJECT + f"material = {{ {words} }}\n"
    made = write_scene(folder, text)
    Image.fromarray(PIXELS).save(made / "map.png")
    Image.fromarray(PIXELS[:2]).save(made / "small.png")
    return made


def only(folder: Path) -> Material:
    (entry,) = Scene.open(folder).objects
    return entry.bound.materials[0]


def decoded(pixels: np.ndarray) -> np.ndarray:
    stored = pixels / 255.0
    return np.where(stored > 0.04045, ((stored + 0.055) / 1.055) ** 2.4, stored / 12.92)


def test_each_map_is_read_as_gltf_has_it(tmp_path: Path) -> None:
    words = 'kind = "principled", albedo = [1, 1, 1], emission = [2, 2, 2], cutoff = 0.5, '
    material = only(with_material(tmp_path, words + ", ".join(f'{k} = "map.png"' for k in MAPS)))
    color = decoded(PIXELS[..., :3])
    expected = {
        "texture": color,
        "emission_texture": color,
        "surface_texture": PIXELS[..., [2, 1]] / 255.0,
        "normal_texture": PIXELS[..., :3] / 127.5 - 1.0,
        "clearcoat_normal_texture": PIXELS[..., :3] / 127.5 - 1.0,
        "opacity_texture": PIXELS[..., 3] / 255.0,
    }
    for key, wanted in expected.items():
        np.testing.assert_allclose(getattr(material, key), wanted, atol=1e-6, err_msg=key)
    assert (material.cutoff, material.opacity) == (0.5, 1.0)


def test_opacity_without_alpha_is_grey_and_needs_no_texture(tmp_path: Path) -> None:
    folder = with_material(
        tmp_path, 'kind = "diffuse", albedo = [1, 0, 0], opacity_texture = "g.png"'
    )
    Image.fromarray(PIXELS[..., 0]).save(folder / "g.png")
    material = only(folder)
    np.testing.assert_allclose(material.opacity_texture, PIXELS[..., 0] / 255.0, atol=1e-6)
    assert material.texture is not None
    assert material.texture.min() == 1.0


def test_a_mesh_without_tangents_gets_them(tmp_path: Path) -> None:
    folder = with_material(
        tmp_path, 'kind = "diffuse", albedo = [1, 0, 0], normal_texture = "map.png"'
    )
    (entry,) = Scene.open(folder).objects
    mesh = entry.bound
    assert mesh.tangents is not None
    assert len(mesh.tangents) == len(mesh.positions) == len(mesh.uvs)


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        ('texture = "gone.png"', "objects.cube.material.texture: there is no file gone.png"),
        ('normal_texture = "../map.png"', "leaves the scene's folder"),
        ('surface_texture = "map.png"', "surface_texture"),  # of principled ones alone
        ('texture = "map.png", opacity_texture = "small.png"', "opacity_texture has 5 x 2 pixels"),
        ('opacity_texture = "color.exr"', "color.exr: cannot be read as a picture"),
        ("opacity = 1.5", "opacity"),
    ],
)
def test_faults_are_named(tmp_path: Path, words: str, problem: str) -> None:
    folder = with_material(tmp_path, f'kind = "diffuse", albedo = [1, 0, 0], {words}')
    with pytest.raises(IprtError) as caught:
        _ = Scene.open(folder).objects
    assert problem in str(caught.value)


@pytest.mark.parametrize("kind", get_args(MaterialKind))
def test_maps_of_mesh_files_are_written_with_edits(tmp_path: Path, kind: MaterialKind) -> None:
    """Bit for bit, up to the length of normals; in files of the same names each time."""
    folder = with_material(tmp_path, 'kind = "diffuse", albedo = [1, 0, 0]')
    maps = {key: read_map(folder / "map.png", key) for key in MAPS}
    given = replace(Material(kind), emission=(2.0, 1.0, 0.5), opacity=0.75, cutoff=0.25, **maps)
    given = replace(given, clearcoat=0.5) if kind == "principled" else given
    (folder / "map.png").unlink()
    files = []
    for _ in range(2):
        save_edits(Scene.open(folder), [ObjectEdit("cube", material=given)])
        files.append(snapshot(folder))
    assert files[0] == files[1]
    found = only(folder)
    assert found == replace(given, alpha=found.alpha, ior=found.ior)
    for key in MAPS:
        if key in ("surface_texture", "clearcoat_normal_texture") and kind != "principled":
            assert getattr(found, key) is None
            continue
        image, wanted = getattr(found, key), getattr(given, key)
        if key in NORMALS:
            image, wanted = (v / np.linalg.norm(v, axis=2, keepdims=True) for v in (image, wanted))
            np.testing.assert_allclose(image, wanted, atol=0.02)
        else:
            np.testing.assert_array_equal(image, wanted, key)


def test_radiance_beyond_white_is_kept(tmp_path: Path) -> None:
    folder = with_material(tmp_path, 'kind = "diffuse", albedo = [1, 0, 0]')
    bright = rng.uniform(0.0, 40.0, (3, 4, 3)).astype(np.float32)
    lamp = Material(emission=(1.0, 1.0, 1.0), emission_texture=bright)
    save_edits(Scene.open(folder), [ObjectEdit("cube", material=lamp)])
    assert [file.suffix for file in (folder / "textures").iterdir()] == [".exr"]
    np.testing.assert_array_equal(only(folder).emission_texture, bright)


def test_a_new_mesh_keeps_its_maps_when_its_material_is_changed(tmp_path: Path) -> None:
    folder = with_material(tmp_path / "scene", 'kind = "diffuse", albedo = [1, 0, 0]')
    for name, material in models():
        if not name.startswith(("texture", "surface_texture", "normal_texture", "cutoff")):
            continue
        path = write_model(tmp_path / f"{name}.glb", material)
        mesh = load_mesh(path)
        edited = replace(mesh.materials[0], albedo=(0.5, 0.25, 0.125))
        save_edits(Scene.open(folder), [ObjectEdit(name, flat(np.eye(4)), edited, mesh, path)])
        again = Scene.open(folder).objects[-1].bound.materials[0]
        assert again.albedo == edited.albedo
        for key in MAPS:
            assert (getattr(again, key) is None) == (getattr(edited, key) is None), (name, key)


def test_nothing_is_written_where_a_map_cannot_be(tmp_path: Path) -> None:
    folder = with_material(tmp_path, 'kind = "diffuse", albedo = [1, 0, 0]')
    (folder / "textures").write_text("in the way")
    before = snapshot(folder)
    key: MapName = "texture"
    given = Material(texture=read_map(folder / "map.png", key))
    with pytest.raises(FormatError):
        save_edits(Scene.open(folder), [ObjectEdit("cube", material=given)])
    assert snapshot(folder) == before
