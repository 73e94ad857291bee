"""Our own scenes are complete, valid, small, and what their scripts say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from iprt.scene.camera import View
from iprt.scene.images import picture_size, read_color
from iprt.scene.scene import Scene
from scenes360.chart import make as chart

SCENES = Path(__file__).parents[2] / "scenes360"
NAMES = ["room", "chart"]


@pytest.mark.parametrize("name", NAMES)
def test_manifest_and_files_fit(name: str) -> None:
    scene = Scene.open(SCENES / name)
    assert scene.name == name
    assert scene.instances
    frame = scene.frame()
    assert frame.color.shape == (scene.height, scene.width, 3)
    for view in scene.views.values():
        assert scene.instances_named(view.objects)
        size = (view.view.width, view.view.height)
        for path in (view.truth, view.truth_background, view.truth_mask):
            assert path is None or picture_size(path) == size
        for x0, y0, x1, y1 in view.cuts:
            assert 0 <= x0 < x1 <= size[0]
            assert 0 <= y0 < y1 <= size[1]


def test_everything_together_is_small() -> None:
    files = [path for path in SCENES.rglob("*") if path.is_file() and path.suffix != ".pyc"]
    assert sum(path.stat().st_size for path in files) < 10e6


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
            0.0 if name == "room" else -0.35, abs=2e-3
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


def test_chart_colour_is_what_the_script_paints() -> None:
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
    ("azimuth", "colour"), [(0, "r"), (90, "g"), (180, "b"), (270, "rg")], ids=str
)
def test_chart_walls_are_where_their_names_say(azimuth: int, colour: str) -> None:
    """FRONT is red at -Z, RIGHT green at +X, BACK blue at +Z, LEFT yellow at -X."""
    color = read_color(SCENES / "chart" / "color.exr")
    view = View(1024, 512, projection="equirect")
    angle = np.deg2rad(azimuth + 5)
    direction = np.array([np.sin(angle), 0.09, -np.cos(angle)])
    x, y = view.project(direction).astype(int)
    wall = dict(zip("rgb", color[y, x], strict=True))
    lit = {name for name, value in wall.items() if value > 0.8 * max(wall.values())}
    assert lit == set(colour)


def test_room_light_is_where_it_should_be() -> None:
    """The window is an opening to the left, and the brightest large area."""
    frame = Scene.open(SCENES / "room").frame()
    view = View(frame.width, frame.height, projection="equirect")
    directions = view.directions()[frame.opening]
    assert 0.005 < frame.opening.mean() < 0.1
    assert (directions[:, 0] < -0.5).mean() > 0.95
    assert frame.color[frame.opening].mean() > 3 * np.median(frame.color)
    assert np.isfinite(frame.color).all()


def test_room_truth_differs_from_its_background_only_by_the_objects() -> None:
    scene = Scene.open(SCENES / "room")
    for view in scene.views.values():
        if view.truth is None or view.truth_background is None:
            continue
        change = np.abs(read_color(view.truth) - read_color(view.truth_background)).max(axis=-1)
        x0, y0, x1, y1 = view.cuts[1]
        outside = np.ones(change.shape, bool)
        outside[y0:y1, x0:x1] = False
        assert change[~outside].mean() > 5 * change[outside].mean()
