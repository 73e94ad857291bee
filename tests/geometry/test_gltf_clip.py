"""glTF animations: nodes that turn, bars that bend, objects that play them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from iprt.errors import FormatError
from iprt.geometry.animated_mesh import load_animated_mesh
from iprt.geometry.mesh import Mesh
from iprt.geometry.meshes import load_mesh
from iprt.scene.scene import Scene
from tests.geometry.gltf_files import STILL, TURN, GltfFile, bar, bar_vertices, bar_weights
from tests.scene.files import IDENTITY, MANIFEST, VIEW, write_scene

Float = NDArray[np.float64]
SUFFIXES = pytest.mark.parametrize("suffix", [".gltf", ".glb"])


def about_z(degrees: float) -> Float:
    return np.asarray(Rotation.from_euler("z", degrees, degrees=True).as_matrix())


def ball(file: GltfFile) -> tuple[int, Float]:
    shape = trimesh.creation.icosphere(subdivisions=2)
    mesh = file.mesh(shape.vertices, shape.faces, NORMAL=file.array(shape.vertices))
    return mesh, np.asarray(shape.vertices, np.float64)


# Rigid nodes ----------------------------------------------------------------------------------


def mobile() -> tuple[GltfFile, Float]:
    """A ball of half size that circles at a distance of 2, and one that stands still."""
    file = GltfFile()
    mesh, vertices = ball(file)
    file.document["scenes"] = [{"nodes": [0, 2]}]
    file.node(children=[1], translation=[1, 0, 0])
    file.node(mesh=mesh, translation=[2, 0, 0], scale=[0.5, 0.5, 0.5])
    file.node(mesh=mesh, translation=[0, 0, -9])
    file.animation((0, "rotation", [0.0, 1.0, 2.0], [STILL, TURN, (0, 0, 1, 0)], "LINEAR"))
    return file, vertices


@SUFFIXES
def test_a_node_turns_what_is_below_it(tmp_path: Path, suffix: str) -> None:
    file, vertices = mobile()
    animated = load_animated_mesh(file.write(tmp_path / f"m{suffix}"), 0)
    assert animated.clip.duration == 2.0
    for time, degrees in ((0.0, 0.0), (0.25, 22.5), (1.0, 90.0), (1.5, 135.0), (2.5, 45.0)):
        mesh = animated.at(time)
        assert mesh.deforms
        circling = np.abs(mesh.positions[:, 2]) < 5.0
        expected = (0.5 * vertices + [2, 0, 0]) @ about_z(degrees).T + [1, 0, 0]
        np.testing.assert_allclose(mesh.positions[circling], expected, atol=1e-6)
        np.testing.assert_allclose(mesh.normals[circling], vertices @ about_z(degrees).T, atol=1e-6)
        np.testing.assert_allclose(
            mesh.positions[~circling], np.add(vertices, [0, 0, -9]), atol=1e-6
        )
        assert mesh.triangles is animated.bound.triangles
        assert mesh.materials is animated.bound.materials


def test_without_time_it_is_what_it_is_without_animation(tmp_path: Path) -> None:
    path = mobile()[0].write(tmp_path / "m.glb")
    still, moving = load_mesh(path), load_animated_mesh(path, 0).at(0.0)
    for name in ("positions", "normals", "triangles", "material_index"):
        np.testing.assert_allclose(getattr(moving, name), getattr(still, name), atol=1e-6)
    assert not still.deforms
    assert still.dropped == ("animations (1)",)
    assert moving.dropped == ()


def test_mirrored_nodes_and_matrices_as_without_animation(tmp_path: Path) -> None:
    file = GltfFile()
    mesh, _ = ball(file)
    sheared = np.array([[-1, 0.2, 0, 3], [0, 1, 0, 0], [0, 0.5, 2, 0], [0, 0, 0, 1.0]])
    file.node(children=[1])
    file.node(mesh=mesh, matrix=[float(v) for v in sheared.T.ravel()])
    file.animation((0, "translation", [0.0, 1.0], [[0, 0, 0], [0, 8, 0]], "LINEAR"))
    path = file.write(tmp_path / "m.glb")
    still, animated = load_mesh(path), load_animated_mesh(path, 0)
    np.testing.assert_allclose(animated.at(0.0).positions, still.positions, atol=1e-6)
    np.testing.assert_allclose(animated.at(0.0).normals, still.normals, atol=1e-6)
    np.testing.assert_array_equal(animated.at(0.0).triangles, still.triangles)
    np.testing.assert_allclose(
        animated.at(0.5).positions, np.add(still.positions, [0, 4, 0]), atol=1e-6
    )


def test_growing_nodes_have_the_normals_of_ellipsoids(tmp_path: Path) -> None:
    radii = np.array([1.0, 2.0, 4.0])
    spline = GltfFile()
    mesh, vertices = ball(spline)
    spline.node(mesh=mesh)
    zero = [0.0, 0.0, 0.0]
    keys = [zero, [1, 1, 1], zero, zero, radii, zero, zero, radii, zero]
    spline.animation((0, "scale", [0.0, 1.0, 2.0], keys, "CUBICSPLINE"))
    shown = load_animated_mesh(spline.write(tmp_path / "s.glb"), 0).at(1.5)
    np.testing.assert_allclose(shown.positions, vertices * radii, atol=1e-6)
    gradient = vertices / radii
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    np.testing.assert_allclose(shown.normals, gradient, atol=1e-6)


# Skins ----------------------------------------------------------------------------------------


@SUFFIXES
@pytest.mark.parametrize("smooth", [False, True])
def test_a_bar_bends(tmp_path: Path, suffix: str, smooth: bool) -> None:
    """Above the joint it turns about it; between, vertices lie on the chord of both places."""
    positions, normals, _ = bar_vertices()
    upper = bar_weights(positions[:, 1], smooth=smooth)[:, None]
    animated = load_animated_mesh(bar(smooth=smooth).write(tmp_path / f"b{suffix}"), "bend")
    for time, degrees in ((0.0, 0.0), (0.5, 45.0), (1.0 - 1e-9, 90.0)):
        mesh, turn = animated.at(time), about_z(degrees)
        turned = (positions - [0, 1, 0]) @ turn.T + [0, 1, 0]
        np.testing.assert_allclose(
            mesh.positions, (1 - upper) * positions + upper * turned, atol=1e-6
        )
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-6)
        whole = (upper == 1.0)[:, 0]
        np.testing.assert_allclose(mesh.normals[whole], normals[whole] @ turn.T, atol=1e-6)
        np.testing.assert_allclose(mesh.normals[upper[:, 0] == 0], normals[upper[:, 0] == 0])
        # Front and back stay so: the bar bends in their plane.
        np.testing.assert_allclose(mesh.normals[:, 2], normals[:, 2], atol=1e-6)


def test_a_skin_at_rest_is_the_mesh_without_it(tmp_path: Path) -> None:
    """And goes where its joints are, not where its own node is."""
    path = bar(smooth=True).write(tmp_path / "b.glb")
    still, bound = load_mesh(path), load_animated_mesh(path, 0).at(0.0)
    for name in ("positions", "normals", "triangles", "uvs"):
        np.testing.assert_allclose(getattr(bound, name), getattr(still, name), atol=1e-6)
    placed = bar(smooth=True, placed=True).write(tmp_path / "p.glb")
    for elsewhere in (load_animated_mesh(placed, 0).at(0.0), load_mesh(placed)):
        np.testing.assert_allclose(elsewhere.positions, still.positions, atol=1e-6)
    assert set(still.dropped) == {"animations (1)"}


def test_an_animation_goes_round(tmp_path: Path) -> None:
    animated = load_animated_mesh(bar().write(tmp_path / "b.glb"), 0)
    for time in (0.25, 0.875):
        for rounds in (1, 7):
            np.testing.assert_array_equal(
                animated.at(time + rounds).positions, animated.at(time).positions
            )
    np.testing.assert_array_equal(animated.at(3.0).positions, animated.at(0.0).positions)


@pytest.mark.parametrize(("dtype", "largest"), [("u1", 255), ("u2", 65535)])
def test_weights_may_be_integers_in_two_sets(tmp_path: Path, dtype: str, largest: int) -> None:
    """The second set of four holds the upper joint; unused places name no joint."""
    file = bar(smooth=True)
    heights = bar_vertices()[0][:, 1]
    upper = np.round(bar_weights(heights, smooth=True) * largest)
    attributes = file.document["meshes"][0]["primitives"][0]["attributes"]
    none = np.zeros_like(upper)

    def both(first: Float, second: Float, kind: str, **more: Any) -> tuple[int, int]:
        sets = [np.stack([part, none, none, none], axis=1) for part in (first, second)]
        return file.array(sets[0], kind, **more), file.array(sets[1], kind, **more)

    attributes["JOINTS_0"], attributes["JOINTS_1"] = both(none, none + 1, "u2")
    attributes["WEIGHTS_0"], attributes["WEIGHTS_1"] = both(
        largest - upper, upper, dtype, normalized=True
    )
    found = load_animated_mesh(file.write(tmp_path / "b.glb"), 0).at(0.5)
    wanted = load_animated_mesh(bar(smooth=True).write(tmp_path / "c.glb"), 0).at(0.5)
    np.testing.assert_allclose(found.positions, wanted.positions, atol=1.0 / largest)


def test_what_is_not_animated_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = bar()
    primitive = file.document["meshes"][0]["primitives"][0]
    primitive["targets"] = [{"POSITION": primitive["attributes"]["POSITION"]}]
    animation = file.document["animations"][0]
    animation["channels"].append({"sampler": 0, "target": {"node": 3, "path": "weights"}})
    mesh = load_animated_mesh(file.write(tmp_path / "b.glb"), "bend").at(0.0)
    assert mesh.dropped == ("morph targets", "animated morph targets")
    (record,) = caplog.records
    assert "morph targets are not read" in record.getMessage()


# In a scene -----------------------------------------------------------------------------------

ANIMATED = f"""
[[objects]]
name = "bar"
mesh = "bar.glb"
to_world = {IDENTITY}
"""


def scene(folder: Path, lines: str, file: GltfFile | None = None) -> Scene:
    folder.mkdir(exist_ok=True)
    (file or bar()).write(folder / "bar.glb")
    return Scene.open(write_scene(folder, MANIFEST + ANIMATED + lines + VIEW))


def test_objects_play_animations_and_move(tmp_path: Path) -> None:
    lines = 'animation = "bend"\n[[objects.keyframes]]\ntime = 0\ntranslation = [0, 0, 0]\n'
    lines += "[[objects.keyframes]]\ntime = 2\ntranslation = [4, 0, 0]\n"
    opened = scene(tmp_path / "s", lines)
    (start,), (later,) = opened.instances, opened.instances_at(0.5)
    assert start.mesh.deforms
    assert later.mesh.triangles is start.mesh.triangles
    assert later.to_world[0, 3] == 1.0
    expected = load_animated_mesh(tmp_path / "s" / "bar.glb", 0).at(0.5)
    np.testing.assert_array_equal(later.mesh.positions, expected.positions)
    assert np.abs(later.mesh.positions - start.mesh.positions).max() > 0.5
    by_number = scene(tmp_path / "n", "animation = 0\n").instances_at(0.5)[0]
    np.testing.assert_array_equal(by_number.mesh.positions, expected.positions)


def test_objects_of_one_file_share_what_becomes_of_it(tmp_path: Path) -> None:
    more = 'animation = "bend"\n' + ANIMATED.replace('"bar"', '"other"') + 'animation = "bend"\n'
    more += ANIMATED.replace('"bar"', '"still"')
    more += ANIMATED.replace('"bar"', '"clay"') + 'animation = "bend"\n'
    more += 'material = { kind = "diffuse", albedo = [0.5, 0.2, 0.1] }\n'
    one, other, still, clay = scene(tmp_path / "s", more).instances_at(0.5)
    assert one.mesh is other.mesh
    assert not still.mesh.deforms
    np.testing.assert_array_equal(clay.mesh.positions, one.mesh.positions)
    assert clay.mesh.materials[0].albedo == (0.5, 0.2, 0.1)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ('animation = "walk"\n', "has no animation 'walk'; it has 0 ('bend')"),
        ("animation = -1\n", "objects.bar.animation: expected a number from 0 on"),
        ("animation = true\n", "objects.bar.animation: expected the name of an animation"),
    ],
)
def test_wrong_animations_are_named(tmp_path: Path, lines: str, message: str) -> None:
    with pytest.raises(Exception) as caught:  # noqa: PT011
        _ = scene(tmp_path / "s", lines).instances
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_only_gltf_files_have_animations(tmp_path: Path) -> None:
    text = MANIFEST + ANIMATED.replace("bar.glb", "cube.obj") + "animation = 0\n" + VIEW
    with pytest.raises(FormatError, match=r"cube\.obj: has no animations"):
        _ = Scene.open(write_scene(tmp_path / "s", text)).instances


def test_twins_are_told_apart_by_number(tmp_path: Path) -> None:
    file = bar()
    file.document["animations"] *= 2
    with pytest.raises(FormatError, match="animations 0, 1 are all named 'bend'; give one's"):
        load_animated_mesh(file.write(tmp_path / "b.glb"), "bend")
    assert load_animated_mesh(tmp_path / "b.glb", 1).clip.duration == 1.0


def test_what_flies_away_is_told(tmp_path: Path) -> None:
    file = GltfFile()
    file.node(mesh=ball(file)[0])
    file.animation((0, "translation", [0.0, 1.0], [[0, 0, 0], [3e38, 0, 0]], "LINEAR"))
    animated = load_animated_mesh(file.write(tmp_path / "b.glb"), 0)
    assert isinstance(animated.at(0.0), Mesh)
    with pytest.raises(FormatError, match=r"animation '0' takes vertices out of all bounds at 0.5"):
        animated.at(0.5)
