"""Keyframes in scene.toml: where objects and views are when, and every fault by its key."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from iprt import cli
from iprt.errors import SceneError
from iprt.scene.scene import Scene
from tests.scene.files import MANIFEST, VIEW, write_rgb, write_scene

Float = NDArray[np.float64]
PLACE = "[0, 0, 2, 0.5, 0, 2, 0, -1, -2, 0, 0, -1.5, 0, 0, 0, 1]"
OBJECT = f'\n[[objects]]\nname = "cube"\nmesh = "cube.obj"\nto_world = {PLACE}\n'
TO_WORLD = np.array(json.loads(PLACE), np.float64).reshape(4, 4)
KEYS = """
[[objects.keyframes]]
time = 1.0
translation = [0, 0, 0]
rotation = [0, 0, 0, 1]
[[objects.keyframes]]
time = 2
scale = 2
[[objects.keyframes]]
time = 3.0
translation = [4, 2, -2]
rotation = [0, 0, 0.7071, 0.7071]
[[objects.keyframes]]
time = 4.0
scale = [2, 4, 8]
"""


def opened(folder: Path, objects: str = "", views: str = "") -> Scene:
    return Scene.open(write_scene(folder, MANIFEST + OBJECT + objects + VIEW + views))


def placed(scene: Scene, time_s: float) -> Float:
    (instance,) = scene.instances_at(time_s)
    return instance.to_world


def test_what_is_put_somewhere_while_it_moves_is_there(tmp_path: Path) -> None:
    (entry,) = opened(tmp_path / "s", KEYS).objects
    elsewhere = np.random.default_rng(0).normal(size=(4, 4))
    elsewhere[3] = 0, 0, 0, 1
    assert entry.motion.moves
    for time in (0.0, 1.5, 2.75, 9.0):
        moved = replace(entry.motion, to_world=entry.motion.before(elsewhere, time))
        np.testing.assert_allclose(moved.at(time), elsewhere, atol=1e-9)


def test_keyframes_come_on_top_of_to_world(tmp_path: Path) -> None:
    """Scaled along its own axes, placed, turned about where that puts its origin, moved."""
    scene = opened(tmp_path / "s", KEYS)
    for time in (0.0, 1.0, 1.5, 2.0, 2.75, 3.0, 3.5, 9.0):
        part = min(max(0.5 * (time - 1.0), 0.0), 1.0)
        later = min(max(0.5 * (time - 2.0), 0.0), 1.0)
        turn = Rotation.from_euler("z", 90.0 * part, degrees=True).as_matrix()
        scale = np.array([2.0, 2.0 + 2.0 * later, 2.0 + 6.0 * later])
        linear = turn @ TO_WORLD[:3, :3] @ np.diag(scale)
        origin = TO_WORLD[:3, 3] + part * np.array([4.0, 2.0, -2.0])
        found = placed(scene, time)
        np.testing.assert_allclose(found[:3, :3], linear, atol=1e-9)
        np.testing.assert_allclose(found[:3, 3], origin, atol=1e-12)
        np.testing.assert_array_equal(found[3], [0, 0, 0, 1])
    np.testing.assert_array_equal(scene.instances[0].to_world, placed(scene, 0.0))


def test_names_choose_objects_in_order(tmp_path: Path) -> None:
    other = OBJECT.replace('"cube"', '"other"')
    scene = opened(tmp_path / "s", KEYS + other)
    assert [i.name for i in scene.instances_at(1.0)] == ["cube", "other"]
    (only,) = scene.instances_at(3.0, ("other",))
    np.testing.assert_array_equal(only.to_world, TO_WORLD)
    first, second = scene.instances_at(1.0), scene.instances_at(3.0)
    assert all(a.mesh is b.mesh for a, b in zip(first, second, strict=True))


def test_steps(tmp_path: Path) -> None:
    keys = "".join(
        f"[[objects.keyframes]]\ntime = {t}\ntranslation = [{t}, 0, 0]\ninterpolation = '{how}'\n"
        for t, how in ((0, "step"), (1, "linear"), (2, "linear"))
    )
    scene = opened(tmp_path / "s", keys)
    for time, x in ((0.0, 0.0), (0.99, 0.0), (1.0, 1.0), (1.5, 1.5), (3.0, 2.0)):
        assert placed(scene, time)[0, 3] - TO_WORLD[0, 3] == x


def test_views_turn_by_numbers(tmp_path: Path) -> None:
    """From 350 to 370 to the right, by 20 degrees; what is not keyed stays."""
    views = "pitch_deg = -20\n[[views.keyframes]]\ntime = 0\nyaw_deg = 350\n"
    views += "[[views.keyframes]]\ntime = 1\nfov_y_deg = 40\n"
    views += "[[views.keyframes]]\ntime = 2\nyaw_deg = 370\nfov_y_deg = 80\n"
    scene = opened(tmp_path / "s", views=views)
    entry = scene.views["ahead"]
    assert entry.view == entry.at(0.0)
    for time, yaw, fov in ((0.0, 350.0, 40.0), (1.0, 360.0, 40.0), (1.5, 365.0, 60.0)):
        view = entry.at(time)
        assert (view.yaw_deg, view.pitch_deg, view.fov_y_deg) == (yaw, -20.0, fov)
        assert (view.width, view.height) == (32, 24)
    assert entry.at(99.0).yaw_deg == 370.0


@pytest.mark.parametrize("loop", [False, True])
def test_time_counts_from_the_first_frame(tmp_path: Path, loop: bool) -> None:
    """And anew in each round of a video that loops."""
    video = 'color = "color.%d.exr"\ndepth = "depth.exr"\nframes = [3, 6]\nfps = 8\n'
    text = MANIFEST.replace('color = "color.exr"\ndepth = "depth.exr"\n', video)
    text += f"loop = {str(loop).lower()}\n"
    folder = write_scene(tmp_path / "s", text + OBJECT + VIEW)
    for index in range(3, 7):
        write_rgb(folder / f"color.{index}.exr", np.full((32, 64, 3), 0.5, np.float32))
    scene = Scene.open(folder)
    assert [scene.time_of(index) for index in range(3, 7)] == [0.0, 0.125, 0.25, 0.375]
    assert scene.time_of(8) == (0.125 if loop else 0.625)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("time = 0", "keyframes[0]: says nothing but when; give translation, rotation or scale"),
        ("scale = 1", "keyframes[0].time: required key is missing"),
        ("time = inf\nscale = 1", "keyframes[0].time: "),
        ("time = 0\nscale = 0", "keyframes[0].scale: expected factors from 1e-06 to 1e+06"),
        ("time = 0\nscale = [1, 2]", "keyframes[0].scale: expected a number, or three"),
        ("time = 0\nscale = true", "keyframes[0].scale: expected a number, or three"),
        ("time = 0\nrotation = [1, 0, 0]", "keyframes[0].rotation: expected 4 values, got 3"),
        ("time = 0\nrotation = [90, 0, 0, 0]", "of length 1; its length is 90"),
        ("time = 0\ntranslation = [1e9, 0, 0]", "keyframes[0].translation[0]: "),
        ("time = 0\ntranslaton = [1, 0, 0]", "translaton: unknown key; did you mean translation?"),
        (
            "time = 1\nscale = 1\n[[objects.keyframes]]\ntime = 1.0\nscale = 2",
            "keyframes: times must ascend; [1] is at 1 s, after 1 s",
        ),
    ],
)
def test_faults_are_named(tmp_path: Path, keys: str, message: str) -> None:
    with pytest.raises(SceneError) as caught:
        opened(tmp_path / "s", f"[[objects.keyframes]]\n{keys}\n")
    assert "objects.cube." in str(caught.value)
    assert message in str(caught.value)


def test_faults_of_views_are_named(tmp_path: Path) -> None:
    views = "[[views.keyframes]]\ntime = 0\npitch_deg = 91\n[[views.keyframes]]\ntime = 1\n"
    with pytest.raises(SceneError) as caught:
        opened(tmp_path / "s", views=views)
    assert "views.ahead.keyframes[0].pitch_deg: expected less than or equal" in str(caught.value)
    assert "views.ahead.keyframes[1]: says nothing but when; give yaw_deg" in str(caught.value)


def test_info_tells_what_moves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = opened(tmp_path / "s", KEYS, "[[views.keyframes]]\ntime = 0.5\nyaw_deg = 5\n")
    assert cli.main(["scene", "info", str(scene.root)]) == 0
    told = capsys.readouterr().out
    assert "moves: keyframes of translation, rotation, scale from 1 to 4 s" in told
    assert "moves: keyframes of yaw from 0.5 to 0.5 s" in told
    assert cli.main(["scene", "info", str(scene.root), "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    (phrase,) = record["objects"][0]["moves"]
    assert phrase.startswith("keyframes of translation")
    assert record["views"]["ahead"]["moves"].startswith("keyframes of yaw")
