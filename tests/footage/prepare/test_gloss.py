"""[[real_materials]]: which texels they take, and what is said about wrong ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from iprt import cli
from iprt.errors import FormatError, SceneError
from iprt.footage.frame import Frame
from iprt.footage.prepare.gloss import Glossy
from iprt.footage.real_material import PARALLEL, Plane, RealMaterial, chromaticity
from iprt.geometry.material import Material
from iprt.scene.manifest import parse_manifest
from iprt.scene.scene import Scene
from tests.oracles.worlds import World
from tests.scene.files import MANIFEST, VIEW, directions, write_scene
from tests.worlds import bright_walls, room_frame

ROOM = World()
FRAME = room_frame(ROOM, 64, 32, bright_walls)
DOWN = ROOM.frame(64, 32).normal[..., 1] > 0.5
COAT = Material("plastic")
FLOOR = '\n[[real_materials]]\nname = "floor"\nkind = "plastic"\n'
PLANE = "plane = { point = [0, -1.3, 0], normal = [0, 2, 0], tolerance = 0.01 }\n"


def test_places_are_kept_while_depth_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    places: list[Frame] = []
    place = RealMaterial.place
    monkeypatch.setattr(
        RealMaterial,
        "place",
        lambda self, frame, *rows: (places.append(frame), place(self, frame, *rows))[1],
    )
    brown = RealMaterial("brown", COAT, color=(0.4, 0.2, 0.1), color_tolerance=0.01)
    stage = Glossy((brown,))
    other = np.where(DOWN[..., None], np.float32((0.8, 0.4, 0.2)), np.float32(0.5))
    frames = [FRAME, replace(FRAME, color=other), replace(FRAME, depth=2.0 * FRAME.depth)]
    found = [stage(frame).gloss for frame in frames]
    assert places == [frames[0], frames[2]]
    for frame, gloss in zip(frames, found, strict=True):
        np.testing.assert_array_equal(gloss, Glossy((brown,))(frame).gloss)
    np.testing.assert_array_equal(found[1], DOWN)


def test_a_plane_takes_what_lies_on_it_and_along_it() -> None:
    floor = RealMaterial("floor", COAT, plane=Plane((0.0, -1.4, 0.0), (0.0, 1.0, 0.0), 0.01))
    np.testing.assert_array_equal(floor.region(FRAME), DOWN)
    # Walls reach down to the floor: a thick slab holds parts of them, which face elsewhere.
    thick = replace(floor, plane=Plane((0.0, -1.4, 0.0), (0.0, -1.0, 0.0), 0.5))
    np.testing.assert_array_equal(thick.region(FRAME), DOWN)
    above = replace(floor, plane=Plane((0.0, -1.0, 0.0), (0.0, 1.0, 0.0), 0.1))
    assert not above.region(FRAME).any()


@pytest.mark.parametrize("noise", [0.0, 3e-4])
@pytest.mark.parametrize("tolerance", [0.01, 0.5])
def test_a_plane_takes_what_fitted_normals_say(noise: float, tolerance: float) -> None:
    """Neighbours show without a fit that a texel's surface is parallel to the plane."""
    wide = room_frame(ROOM, 512, 256, bright_walls)
    error = 1.0 + noise * np.random.default_rng(3).standard_normal(wide.depth.shape)
    frame = replace(wide, depth=(wide.depth * error).astype(np.float32), normal=None)
    floor = RealMaterial("floor", COAT, plane=Plane((0.0, -1.4, 0.0), (0.0, 1.0, 0.0), tolerance))
    height = (frame.depth[..., None] * directions(512, 256))[..., 1]
    near = np.abs(height + 1.4) <= tolerance
    fitted = near & (np.abs(frame.fitted_normal[..., 1]) >= PARALLEL)
    assert np.count_nonzero(near & ~fitted) > 100 or tolerance < 0.1
    assert np.count_nonzero(floor.place(frame) != fitted) <= 1e-3 * np.count_nonzero(fitted)


def test_a_color_is_a_hue_whatever_lights_it() -> None:
    color = np.zeros((32, 64, 3), np.float32)
    color[4], color[5], color[6] = (0.2, 0.1, 0.05), (20.0, 10.0, 5.0), (0.2, 0.2, 0.2)
    brown = RealMaterial("wood", COAT, color=(0.4, 0.2, 0.1), color_tolerance=1e-3)
    rows = brown.region(replace(FRAME, color=color)).all(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(rows), [4, 5])
    apart = np.linalg.norm(chromaticity(color[6, 0]) - chromaticity(color[4, 0]))
    wide = replace(brown, color_tolerance=1.01 * float(apart)).region(replace(FRAME, color=color))
    np.testing.assert_array_equal(np.flatnonzero(wide.all(axis=1)), [4, 5, 6])


def test_a_color_is_that_of_the_reference_where_white_balance_drifts() -> None:
    brown = RealMaterial("wood", COAT, color=(0.9, 0.8, 0.4), color_tolerance=0.01)
    balance = np.array([0.6, 1.0, 1.7])
    drifted = replace(FRAME, color=(FRAME.color * balance).astype(np.float32))
    mapped = replace(drifted, color_map=np.diag(1.0 / balance))
    assert brown.region(FRAME).any()
    np.testing.assert_array_equal(brown.region(mapped), brown.region(FRAME))
    assert not brown.region(drifted).any()


@pytest.mark.parametrize("size", [(16, 8), (64, 32), (100, 50), (256, 128)])
def test_a_mask_of_any_size_covers_the_panorama(size: tuple[int, int]) -> None:
    width, height = size
    mask = np.zeros((height, width), bool)
    mask[height // 2 :, : width // 4] = True
    found = RealMaterial("left", COAT, mask=mask).region(FRAME)
    wanted = np.zeros((32, 64), bool)
    wanted[16:, :16] = True
    np.testing.assert_array_equal(found, wanted)


def test_all_that_is_given_must_hold_and_the_last_entry_wins() -> None:
    mask = np.zeros((32, 64), bool)
    mask[:, :20] = True
    plane = Plane((0.0, -1.4, 0.0), (0.0, 1.0, 0.0), 0.01)
    floor = RealMaterial("floor", COAT, plane=plane)
    metal = Material("conductor", (0.9, 0.8, 0.7))
    part = RealMaterial("part", metal, plane=plane, mask=mask)
    frame = Glossy((floor, part))(FRAME)
    assert frame.gloss is not None
    np.testing.assert_array_equal(frame.gloss, np.where(DOWN, np.where(mask, 2, 1), 0))
    assert frame.real_materials == (COAT, metal)
    assert Glossy(())(FRAME) is FRAME


def test_windows_and_sky_are_never_glossy() -> None:
    opening = np.zeros((32, 64), bool)
    opening[20:24] = True
    depth = FRAME.depth.copy()
    depth[28:] = np.inf
    everything = RealMaterial("all", COAT, mask=np.ones((2, 4), bool))
    found = everything.region(replace(FRAME, opening=opening, depth=depth))
    assert found[:20].all()
    assert not found[20:24].any()
    assert not found[28:].any()


# In a scene's folder --------------------------------------------------------------------------


def test_a_scenes_frame_knows_its_floor(tmp_path: Path) -> None:
    frame = Scene.open(write_scene(tmp_path, MANIFEST + FLOOR + PLANE)).frame()
    assert frame.gloss is not None
    assert 0.1 < (frame.gloss == 1).mean() < 0.5
    assert frame.real_materials == (Material("plastic", alpha=0.1, ior=1.5),)
    assert Scene.open(write_scene(tmp_path, MANIFEST)).frame().gloss is None


def test_a_mask_turns_with_the_pictures(tmp_path: Path) -> None:
    manifest = MANIFEST.replace("[video]", "[video]\nyaw_offset_deg = 90.0")
    write_scene(tmp_path, manifest + FLOOR + 'mask = "m.png"\n')
    mask = np.zeros((8, 16), np.uint8)
    mask[:, 1] = 7
    Image.fromarray(mask).save(tmp_path / "m.png")
    frame = Scene.open(tmp_path).frame()
    assert frame.gloss is not None
    np.testing.assert_array_equal(np.flatnonzero(frame.gloss.all(axis=0)), range(20, 24))


def test_a_mask_belongs_to_the_scene(tmp_path: Path) -> None:
    write_scene(tmp_path, MANIFEST + FLOOR + 'mask = "m.png"\n')
    with pytest.raises(SceneError, match=r"real_materials.floor.mask: there is no file m.png"):
        Scene.open(tmp_path)
    Image.new("L", (16, 9)).save(tmp_path / "m.png")
    scene = Scene.open(tmp_path)
    with pytest.raises(FormatError, match=r"m.png: 16 x 9 pixels; a mask covers the whole"):
        scene.frame()
    with pytest.raises(SceneError, match="belongs to the scene"):
        scene.require_not_ours(tmp_path / "m.png")


def test_info_and_check_tell_what_a_region_covers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    empty = FLOOR.replace("floor", "shelf") + PLANE.replace("-1.3", "0.7")
    write_scene(tmp_path, MANIFEST + FLOOR + PLANE + empty + VIEW)
    assert cli.main(["scene", "check", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "warning: shelf: no texel belongs to it" in told
    assert "floor" not in told
    assert "see the warnings" in told
    assert cli.main(["scene", "info", str(tmp_path)]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("glossy")]
    assert "floor: plastic, alpha 0.1; " in lines[0]
    assert "shelf: plastic, alpha 0.1; 0.00% of all directions" in lines[1]


# What is wrong with the manifest --------------------------------------------------------------


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("", "real_materials.floor: say where the surface is: give a mask, a color or a plane"),
        ('kind = "glass"', "real_materials.floor: expected kind = 'plastic' or 'conductor'"),
        ("ior = 0.5", "real_materials.floor.ior: expected greater than 1"),
        ("alpha = 2.0", "real_materials.floor.alpha: expected less than or equal to 1"),
        ("reflectance = [1, 1, 1]", "real_materials.floor.reflectance: unknown key"),
        ("color = [0.0, 0.0, 0.0]", "real_materials.floor.color: expected at least one value"),
        (
            "color_tolerance = 0.1",
            "real_materials.floor.color_tolerance: has no effect without color",
        ),
        (
            "plane = { point = [0, 0, 0], normal = [0, 0, 0] }",
            "real_materials.floor.plane.normal: expected at least one value that is not 0",
        ),
        (PLANE + FLOOR + PLANE, "real_materials: 2 of them are named 'floor'; names must differ"),
    ],
)
def test_every_problem_is_a_line_with_its_key(lines: str, expected: str) -> None:
    table = FLOOR.replace('kind = "plastic"\n', "") if lines.startswith("kind") else FLOOR
    where = "" if "plane" in lines or not lines or "tolerance" in lines else PLANE
    with pytest.raises(SceneError) as error:
        parse_manifest(MANIFEST + table + where + lines + "\n", "scene.toml")
    assert expected in str(error.value)


def test_one_table_is_not_a_list() -> None:
    text = MANIFEST + FLOOR.replace("[[", "[").replace("]]", "]") + PLANE
    with pytest.raises(SceneError, match=r"write \[\[real_materials\]\]"):
        parse_manifest(text, "scene.toml")
