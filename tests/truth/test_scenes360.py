"""Our own scenes are complete, valid, small, and what their scripts say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from iprt.files.images import picture_size, read_color
from iprt.footage.video.picture_tracks import frame_path
from iprt.geometry.camera import View
from iprt.measure.view_truth import truth_indices
from iprt.scene.scene import Scene
from scenes360.chart import make as chart
from scenes360.train import plan as train

SCENES = Path(__file__).parents[2] / "scenes360"
NAMES = ["room", "chart", "train", "lounge", "yard"]


def truth_file(scene: Scene, path: Path, index: int) -> Path:
    return frame_path(scene.root, str(path.relative_to(scene.root)), index)


@pytest.mark.thorough
@pytest.mark.parametrize("name", NAMES)
def test_manifest_and_files_fit(name: str) -> None:
    scene = Scene.open(SCENES / name)
    assert scene.name == name
    assert scene.instances
    frame = scene.frame()
    assert frame.color.shape == (*scene.source.size[::-1], 3)
    for view in scene.views.values():
        assert scene.instances_named(view.objects)
        size = (view.view.width, view.view.height)
        for path in (view.truth, view.truth_background, view.truth_mask):
            if path is not None:
                files = [truth_file(scene, path, i) for i in truth_indices(scene, view.name)]
                assert files
                assert all(picture_size(file) == size for file in files)
        for x0, y0, x1, y1 in view.cuts:
            assert 0 <= x0 < x1 <= size[0]
            assert 0 <= y0 < y1 <= size[1]


def test_everything_together_is_small() -> None:
    clip = [
        path for path in (SCENES / "train").rglob("*") if path.suffix in (".mkv", ".exr", ".ply")
    ]
    assert sum(path.stat().st_size for path in clip) < 4e6
    files = [path for path in SCENES.rglob("*") if path.is_file() and path.suffix != ".pyc"]
    assert sum(path.stat().st_size for path in files) < 24e6


@pytest.mark.parametrize("name", NAMES)
def test_meshes_are_closed_to_the_outside(name: str) -> None:
    for instance in Scene.open(SCENES / name).instances:
        mesh = instance.mesh
        a, b, c = (mesh.positions[mesh.triangles[:, i]].astype(np.float64) for i in range(3))
        face = np.cross(b - a, c - a)
        assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 > 0.0, instance.name
        agree = np.einsum("ij,ij->i", face, mesh.normals[mesh.triangles[:, 0]])
        assert (agree > 0.0).mean() > 0.99, instance.name
        assert mesh.positions[:, 1].min() == pytest.approx(
            -0.35 if name == "chart" else 0.0, abs=2e-3
        )


def test_chart_depth_is_analytic() -> None:
    frame = Scene.open(SCENES / "chart").frame()
    directions = View(frame.width, frame.height, projection="equirect").directions()
    half_step = 0.5 * chart.DEPTH_SCALE
    points = directions * frame.depth[..., None].astype(np.float64)
    # Every point lies on the box: on one of its planes, and beyond none.
    off = np.stack([points - chart.BOX_LOW, chart.BOX_HIGH - points]).min(axis=(0, -1))
    assert np.abs(off).max() < 1.01 * half_step
    assert not frame.opening.any()


def test_chart_color_is_the_scripts() -> None:
    stored = read_color(SCENES / "chart" / "color.exr")
    rng = np.random.default_rng(5)
    row, column = rng.integers((512, 1024), size=(400, 2)).T
    n = chart.SUPERSAMPLING
    offset = (np.arange(n) + 0.5) / n
    x = column[:, None, None] + offset[None, None, :]
    y = row[:, None, None] + offset[None, :, None]
    pixels = np.stack(np.broadcast_arrays(x, y), axis=-1)
    painted = chart.radiance(chart.PANORAMA.unproject(pixels)).mean(axis=(1, 2))
    np.testing.assert_allclose(stored[row, column], painted, rtol=2e-3, atol=1e-4)


@pytest.mark.parametrize(
    ("azimuth", "primaries"), [(0, "r"), (90, "g"), (180, "b"), (270, "rg")], ids=str
)
def test_chart_walls_are_where_their_names_say(azimuth: int, primaries: str) -> None:
    """FRONT is red at -Z, RIGHT green at +X, BACK blue at +Z, LEFT yellow at -X."""
    color = read_color(SCENES / "chart" / "color.exr")
    view = View(1024, 512, projection="equirect")
    angle = np.deg2rad(azimuth + 5)
    direction = np.array([np.sin(angle), 0.09, -np.cos(angle)])
    x, y = view.project(direction).astype(int)
    wall = dict(zip("rgb", color[y, x], strict=True))
    lit = {name for name, value in wall.items() if value > 0.8 * max(wall.values())}
    assert lit == set(primaries)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["room", "lounge"])
def test_light_is_where_it_should_be(name: str) -> None:
    """The window is an opening to the left, and the brightest large area."""
    frame = Scene.open(SCENES / name).frame()
    view = View(frame.width, frame.height, projection="equirect")
    directions = view.directions()[frame.opening]
    assert 0.005 < frame.opening.mean() < 0.1
    assert (directions[:, 0] < -0.5).mean() > 0.95
    assert frame.color[frame.opening].mean() > 3 * np.median(frame.color)
    assert np.isfinite(frame.color).all()


@pytest.mark.parametrize("name", ["room", "lounge", "train", "yard"])
def test_truth_differs_from_its_background_only_by_the_objects(name: str) -> None:
    scene = Scene.open(SCENES / name)
    for view in scene.views.values():
        if view.truth is None or view.truth_background is None:
            continue
        for index in truth_indices(scene, view.name):
            files = [truth_file(scene, path, index) for path in (view.truth, view.truth_background)]
            change = np.abs(read_color(files[0]) - read_color(files[1])).max(axis=-1)
            x0, y0, x1, y1 = view.cuts[-1]
            outside = np.ones(change.shape, bool)
            outside[y0:y1, x0:x1] = False
            assert change[~outside].mean() > 5 * change[outside].mean()


def test_train_is_where_its_script_says() -> None:
    """In every frame the locomotive is seen at its place, and farther things where it is not."""
    scene = Scene.open(SCENES / "train")
    assert len(scene.frame_indices) == train.FRAMES
    view = View(*scene.source.size, projection="equirect")
    with scene.stream(scene.frame_indices) as frames:
        for frame in frames:
            x = train.train_x(scene.time_of(frame.index))
            for offset, seen in ((0.0, True), (0.45, False)):
                middle = np.array([x + offset, train.RAIL_TOP + 0.2, train.TRACK_Z])
                column, row = view.project(middle).astype(int)
                distance = float(np.linalg.norm(middle))
                assert (frame.depth[row, column] < distance) == seen, (frame.index, offset)


def test_only_the_train_moves() -> None:
    """Depth has no loss: what stands still is the same to the bit, and little of it is passed."""
    scene = Scene.open(SCENES / "train")
    depth = np.stack([scene.raw_frame(i).depth for i in (0, 8, 15, 23)])
    still = (depth == depth[0]).all(axis=0)
    assert 0.01 < 1.0 - still.mean() < 0.1
    view = View(*scene.source.size, projection="equirect").directions()
    moved = (view * depth[0][..., None])[~still]
    assert (moved[:, 1] < -0.9).mean() > 0.99


def test_inserted_objects_move_as_the_script_says() -> None:
    scene = Scene.open(SCENES / "train")
    for index in scene.frame_indices:
        time_s = scene.time_of(index)
        ball, knot = scene.instances_at(time_s, ("ball", "knot"))
        up = ball.to_world[1, 3] - train.ball()[0][1, 3]
        hop = (time_s / train.LAST_S * train.HOPS) % 1.0
        assert up == pytest.approx(4.0 * train.HOP_HEIGHT * hop * (1.0 - hop), abs=1e-3)
        turn = np.rad2deg(np.arctan2(knot.to_world[0, 2], knot.to_world[0, 0])) % 360.0
        wanted = train.KNOT_TURN_DEG * time_s / train.LAST_S
        assert turn == pytest.approx(wanted, abs=0.1)


def test_truths_of_train_follow_each_other() -> None:
    indices = truth_indices(Scene.open(SCENES / "train"), "rug")
    assert any(index + 1 in indices for index in indices)
