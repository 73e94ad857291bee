"""`iprt scene add`: how large, which way up and where an object stands, and what it tells of it."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from iprt import cli
from iprt.errors import FormatError, SceneError
from iprt.files.safe_reading import MAX_OBJECTS
from iprt.scene import manifest_writing
from iprt.scene.manifest import MANIFEST_NAME
from iprt.scene.mesh_pose import UP_AXES, MeshPose
from iprt.scene.new_object import add_object
from iprt.scene.scene import Scene
from tests.geometry.gltf_files import bar
from tests.geometry.usd_files import square, usda
from tests.scene.files import (
    CUBE,
    IDENTITY,
    LOW,
    MANIFEST,
    OBJECT,
    VIEW,
    snapshot,
    write_scene,
)

LOOK = ("--look", "0", "-50")


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("iprt.scene.real_materials.MIN_HEIGHT", 129)  # gloss is not looked for
    return write_scene(tmp_path / "room", MANIFEST + VIEW, width=256)


def wedge(path: Path, size: float = 1.0) -> Path:
    """1 x 2 x 3 along x, y, z, with a corner of its own in each direction."""
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    box.vertices *= size
    box.export(path)
    return path


def placed(room: Path, name: str) -> Any:
    """(V, 3) the vertices of an object in the world."""
    (instance,) = Scene.open(room).instances_named((name,))
    matrix = instance.to_world
    return instance.mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]


def test_a_usd_file_comes_with_its_layers_and_has_its_size(room: Path, tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="needs the extra `usd`")
    source = tmp_path / "files"
    (source / "parts").mkdir(parents=True)
    usda(source / "parts" / "square.usda", square(), up="Z", unit=0.01)
    body = 'def "a" (references = @parts/square.usda@)\n{\n}'
    mesh = usda(source / "square.usda", body, up="Z", unit=0.01)
    added = add_object(room, mesh, 0.0, -50.0, pose=MeshPose(unit_m=1.0))
    files = sorted(path.name for path in (room / "meshes").rglob("*.usda"))
    assert files == ["square.usda", "square.usda"]
    vertices = placed(room, "square")
    np.testing.assert_allclose(np.ptp(vertices, axis=0), [0.01, 0.0, 0.01], atol=1e-5)
    assert vertices[:, 1].min() == pytest.approx(LOW[1], abs=1e-3)
    assert added.hints == ()


@pytest.mark.thorough
@pytest.mark.parametrize("up", UP_AXES)
def test_the_axis_that_is_up_points_up(up: str, room: Path, tmp_path: Path) -> None:
    mesh = wedge(tmp_path / "w.ply")
    words = ["scene", "add", str(room), str(mesh), *LOOK, "--unit=0.1", "--up", up, "--rotate=30"]
    assert cli.main(words) == 0
    (instance,) = Scene.open(room).instances
    axis = np.eye(3)["xyz".index(up[-1])] * (-1.0 if up.startswith("-") else 1.0)
    linear = instance.to_world[:3, :3]
    assert np.allclose(linear @ axis, [0.0, 0.1, 0.0], atol=1e-7)
    assert np.linalg.det(linear) == pytest.approx(1e-3)
    corners = placed(room, "w")
    assert corners[:, 1].min() == pytest.approx(LOW[1], abs=5e-3)
    assert np.ptp(corners[:, 1]) == pytest.approx(0.1 * (1.0 + "xyz".index(up[-1])), rel=1e-5)


@pytest.mark.thorough
@pytest.mark.parametrize("degrees", [90.0, -30.0, 400.0])
def test_objects_turn_to_the_left(degrees: float, room: Path, tmp_path: Path) -> None:
    added = add_object(room, wedge(tmp_path / "w.ply"), 0, -50, pose=MeshPose(turn_deg=degrees))
    (instance,) = Scene.open(room).instances
    linear = instance.to_world[:3, :3]
    turn = Rotation.from_matrix(linear / np.cbrt(np.linalg.det(linear))).as_rotvec(degrees=True)
    assert np.allclose(turn, [0.0, (degrees + 180.0) % 360.0 - 180.0, 0.0], atol=1e-4)
    assert f"turned by {degrees:g} degrees" in added.size


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("unit", "metres"),
    [("m", 1.0), ("cm", 0.01), ("mm", 0.001), ("in", 0.0254), ("ft", 0.3048), ("0.5", 0.5)],
)
def test_units(
    unit: str, metres: float, room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh = wedge(tmp_path / "w.ply", 0.2 / metres)
    assert cli.main(["scene", "add", str(room), str(mesh), *LOOK, "--unit", unit]) == 0
    assert np.allclose(np.ptp(placed(room, "w"), axis=0), [0.2, 0.4, 0.6], atol=1e-4)
    out = capsys.readouterr().out
    assert "w: 0.20 x 0.40 x 0.60 m (width, height, depth); in its file " in out
    assert f"units of {metres:.4g} m, +Y up\n" in out
    assert "hint" not in out


def test_a_turned_object_is_measured_as_it_stands(room: Path, tmp_path: Path) -> None:
    pose = MeshPose(up="z", height_m=0.3)
    added = add_object(room, wedge(tmp_path / "w.ply"), 0, -50, pose=pose)
    assert added.size == (
        "0.10 x 0.30 x 0.20 m (width, height, depth); in its file 1 x 2 x 3 units of 0.1 m, +Z up"
    )
    corners = placed(room, "w")
    assert np.allclose(added.base[[0, 2]], 0.5 * (corners.min(0) + corners.max(0))[[0, 2]])
    assert added.base[1] == pytest.approx(corners[:, 1].min())


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--unit", "cm", "--height", "1"], "--height and --unit both say how large"),
        (["--unit", "parsec"], "--unit parsec: expected m, cm, mm, in, ft, or the metres"),
        (["--unit", "0"], "--unit 0: expected metres above 0"),
        (["--unit", "nan"], "--unit nan: expected metres above 0"),
        (["--rotate", "inf"], "--rotate inf: expected degrees"),
        (["--unit", "1e9"], "the object would be 3e+09 m large; objects are from 1e-06 to 1e+06 m"),
        (["--height", "1e-300"], "the object would be 1.5e-300 m large"),
        (["--animation", "walk"], "w.ply: has no animations"),
    ],
)
def test_flags_that_make_no_sense(
    words: list[str], message: str, room: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    wedge(tmp_path / "w.ply")
    before = snapshot(room)
    assert message in fails("scene", "add", room, tmp_path / "w.ply", *LOOK, *words)
    assert snapshot(room) == before


@pytest.mark.thorough
def test_an_animation_by_name_or_number(
    room: Path,
    tmp_path: Path,
    fails: Callable[..., str],
    capsys: pytest.CaptureFixture[str],
) -> None:
    mesh = bar().write(tmp_path / "bar.glb")
    words = ["scene", "add", str(room), str(mesh), *LOOK]
    assert cli.main(words) == 0
    assert "hint: bar: its file has the animations 0 ('bend'); --animation" in (
        capsys.readouterr().out
    )
    for choice in ("bend", "0"):
        assert cli.main([*words, "--animation", choice]) == 0
        assert "hint" not in capsys.readouterr().out
    tables = Scene.open(room).manifest.objects
    assert [table.animation for table in tables] == [None, "bend", 0]
    moving = [entry.describe() for entry in Scene.open(room).objects]
    assert moving == [(), *[("animation 'bend' of 1 s",)] * 2]
    before = snapshot(room)
    assert "has no animation 'wave'; it has 0 ('bend')" in fails(*words, "--animation", "wave")
    assert snapshot(room) == before


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("suffix", "size", "lowest", "hint"),
    [
        (".ply", (60, 170, 40), (-30, 0, -20), "170 units of its file; is it --unit cm (1.7 m)"),
        (".ply", (2500, 900, 40), (0, 0, 0), "--unit mm (2.5 m)"),
        (".ply", (0.6, 0.4, 1.7), (-0.3, -0.2, 0), "if that should be +Z, give --up z"),
        (".stl", (1, 1, 1), (0, 0, 0), "if that should be +Z, give --up z"),
        (".glb", (0.6, 0.4, 1.7), (-0.3, -0.2, 0), None),
        (".ply", (0.6, 1.7, 0.4), (-0.3, 0, -0.2), None),
        (".ply", (1, 1, 1), (-0.5, -0.5, -0.5), None),
    ],
)
def test_likely_mistakes_are_hinted_at(
    suffix: str,
    size: tuple[float, ...],
    lowest: tuple[float, ...],
    hint: str | None,
    room: Path,
    tmp_path: Path,
) -> None:
    box = trimesh.creation.box(size)
    box.apply_translation(np.array(lowest) + 0.5 * np.array(size))
    box.export(tmp_path / f"b{suffix}")
    added = add_object(room, tmp_path / f"b{suffix}", 0, -50)
    if hint is None:
        assert added.hints == ()
    else:
        assert any(hint in line for line in added.hints)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("unit", "warning"),
    [
        (0.1, None),
        (10.0, "is larger than the room, which is 4."),
        (1e-5, "too small to be seen"),
    ],
)
def test_add_warns_as_check_does(
    unit: float,
    warning: str | None,
    room: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = [str(room), str(wedge(tmp_path / "w.ply")), *LOOK, "--unit", str(unit)]
    assert cli.main(["scene", "add", *words]) == 0
    of_add = [line for line in capsys.readouterr().out.splitlines() if "warning: w" in line]
    assert cli.main(["scene", "check", str(room)]) == 0
    of_check = [line for line in capsys.readouterr().out.splitlines() if "warning: w" in line]
    assert of_add == of_check
    assert len(of_add) == (warning is not None)
    assert warning is None or warning in of_add[0]


def test_what_surrounds_the_capture_centre_is_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_scene(tmp_path / "s", MANIFEST + OBJECT)
    assert cli.main(["scene", "check", str(folder)]) == 0
    assert "warning: cube: surrounds the capture centre" in capsys.readouterr().out


# Limits -------------------------------------------------------------------------------------------


def many(count: int) -> str:
    return MANIFEST + "".join(
        f'[[objects]]\nname = "{i}"\nmesh = "none.obj"\nto_world = {IDENTITY}\n'
        for i in range(count)
    )


def test_one_object_too_many_is_not_added(
    tmp_path: Path, fails: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_scene(tmp_path / "s", many(MAX_OBJECTS).replace("none.obj", "cube.obj"))
    before = snapshot(folder)
    line = fails("scene", "add", folder, folder / "cube.obj", *LOOK)
    assert f"has {MAX_OBJECTS} objects, and no more are read" in line
    assert snapshot(folder) == before


# Nothing half written -----------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_mesh_is_taken_away_again_if_scene_toml_cannot_be_written(
    error: BaseException, room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "m.obj").write_text(CUBE)
    before = snapshot(room)
    write = Path.write_bytes

    def full(self: Path, data: bytes) -> int:
        if b"[[objects]]" in data:
            write(self, data[:100])
            raise error
        return write(self, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises((FormatError, KeyboardInterrupt)):
        add_object(room, tmp_path / "m.obj", 0, -50)
    assert snapshot(room) == before
    assert not (room / "meshes").exists()


def test_a_read_only_scene_is_left_alone(room: Path, tmp_path: Path) -> None:
    (tmp_path / "m.obj").write_text(CUBE)
    (room / MANIFEST_NAME).chmod(0o444)
    before = snapshot(room)
    with pytest.raises(SceneError, match=r"scene\.toml: is read-only; make it writable"):
        add_object(room, tmp_path / "m.obj", 0, -50)
    assert snapshot(room) == before


def _add(room: Path, mesh: Path) -> str:
    return add_object(room, mesh, 0, -50).name


@pytest.mark.thorough
def test_one_who_changes_a_scene_keeps_others_waiting(room: Path, tmp_path: Path) -> None:
    (tmp_path / "m.obj").write_text(CUBE)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        with manifest_writing.changing(room):
            waiting = pool.apply_async(_add, (room, tmp_path / "m.obj"))
            with pytest.raises(multiprocessing.TimeoutError):
                waiting.get(timeout=0.0)
            assert "m.obj" not in (room / MANIFEST_NAME).read_text()
        assert waiting.get(timeout=600) == "m"
