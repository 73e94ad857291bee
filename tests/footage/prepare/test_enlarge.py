"""Depth of fewer values than color, against closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from iprt import cli
from iprt.footage.prepare.enlarge import Grid, at_full_size, enlarged
from iprt.footage.video.depth_code import usable
from iprt.scene.scene import Scene
from tests.footage.video.encoding import Track, grey16, plain, write_video
from tests.scene.files import (
    MANIFEST,
    OBJECT,
    box_room,
    directions,
    write_channels,
    write_scene,
)

Depth = NDArray[np.float32]


def repeated(depth: NDArray[np.floating], height: int, centre: float = 0.5) -> Depth:
    """Enlarged by the nearest texel, as `centre` 0.5 and 0 choose it."""
    h, w = depth.shape
    rows = ((np.arange(height) + centre) * h / height).astype(int)
    columns = ((np.arange(2 * height) + centre) * w / (2 * height)).astype(int)
    return np.asarray(depth[rows][:, columns], np.float32)


def room(height: int) -> Depth:
    return box_room(2 * height, height)[0].astype(np.float32)


def near_edges(height: int, reach: int) -> NDArray[np.bool_]:
    """Texels within `reach` of an edge of the room."""
    _, normal = box_room(2 * height, height)
    wall = (normal @ [1.0, 2.0, 4.0]).astype(int)
    edge = np.zeros(wall.shape, bool)
    for axis in (0, 1):
        edge |= np.diff(wall, axis=axis, prepend=wall.take([0], axis)) != 0
    return np.asarray(ndimage.binary_dilation(edge, iterations=reach))


@pytest.mark.parametrize(("small", "large"), [(64, 256), (50, 128), (64, 128)])
@pytest.mark.parametrize("centre", [0.5, 0.0])
def test_planes_are_exact(small: int, large: int, centre: float) -> None:
    stored = repeated(room(small), large, centre)
    grid = Grid.of(stored)
    assert grid is not None
    full = at_full_size(stored, grid, 2 * large, large)
    error = np.abs(full / room(large) - 1.0)
    away = ~near_edges(large, 3 * large // small)
    assert error[away].max() < 1e-5
    assert np.abs(stored / room(large) - 1.0)[away].max() > 0.01
    assert error.max() < 5.0 / small, "at edges, walls stay within a coarse texel of their place"


def test_surfaces_at_a_gap_are_not_mixed() -> None:
    """A slanted panel before a wall, with half the depth: nothing lies between them."""
    height = 256

    def both(height: int) -> tuple[Depth, Depth, NDArray[np.bool_]]:
        w = directions(2 * height, height)
        panel = np.float32(1.0) / np.maximum(w @ [0.2, 0.1, -0.9], 1e-3)
        on_panel = np.hypot(w[..., 0], w[..., 1]) < 0.3 - 0.2 * w[..., 0]
        return panel.astype(np.float32), room(height), on_panel & (w[..., 2] < 0.0)

    panel, wall, inside = both(64)
    full = enlarged(np.where(inside, panel, wall), 2 * height, height)
    panel, wall, inside = both(height)
    ahead = directions(2 * height, height)[..., 2] < -0.85
    off = np.minimum(np.abs(full / panel - 1.0), np.abs(full / wall - 1.0))
    assert np.percentile(off[ahead], 98) < 0.01
    assert off[ahead].max() < 0.06, "where three texels are all that tells a plane"
    is_panel = np.abs(full / panel - 1.0) < 0.06
    assert (is_panel != inside)[ahead].sum() < 0.06 * inside.sum(), "the outline stays in place"


@pytest.mark.parametrize(("small", "most"), [(48, 0.2), (64, 0.16)])
def test_strips_of_a_single_texel_belong_to_the_plane_beside_them(small: int, most: float) -> None:
    """A table top, turned, whose corners and far edge show little of it to fit a plane to."""

    def table(height: int) -> tuple[Depth, NDArray[np.bool_]]:
        w = directions(2 * height, height)
        top = np.divide(-0.5, w[..., 1], out=np.zeros(w.shape[:2]), where=w[..., 1] < 0.0)
        points = w * top[..., None]
        aside, along = points @ [0.8, 0.0, 0.6] + 0.3, points @ [-0.6, 0.0, 0.8] + 1.5
        on = (top > 0.0) & (np.abs(aside) < 0.5) & (np.abs(along) < 0.5)
        return np.where(on, top, room(height)).astype(np.float32), on

    full = enlarged(table(small)[0], 8 * small, 4 * small)
    truth, on = table(4 * small)
    assert (np.abs(full / truth - 1.0) > 0.01)[on].mean() < most


@pytest.mark.parametrize("nothing", [0.0, -1.0, np.nan, np.inf])
def test_holes_stay_holes(nothing: float) -> None:
    height = 256

    def with_hole(height: int) -> tuple[Depth, NDArray[np.bool_]]:
        w = directions(2 * height, height)
        hole = w @ [0.6, 0.0, -0.8] > 0.9
        return np.where(hole, np.float32(nothing), room(height)), hole

    small, _ = with_hole(64)
    stored = repeated(small, height)
    _, hole = with_hole(height)
    full = at_full_size(stored, Grid.of(stored), 2 * height, height)
    rim = ndimage.binary_dilation(hole, iterations=3) & ~ndimage.binary_erosion(hole, iterations=3)
    assert not usable(full)[hole & ~rim].any()
    assert usable(full)[~hole & ~rim].all()
    # A mask of the sky at the size of color is finer than the depth that it is cut out of.
    stored = np.where(hole, np.float32(nothing), repeated(room(64), height))
    full = at_full_size(stored, Grid.of(stored), 2 * height, height)
    np.testing.assert_array_equal(usable(full), ~hole)
    away = ~hole & ~near_edges(height, 12)
    assert np.abs(full / room(height) - 1.0)[away].max() < 1e-5


def quantised(depth: Depth) -> dict[str, Depth]:
    """As it is, and as files of few bits hold it."""
    there, most = usable(depth), depth[usable(depth)].max()
    inverse = np.divide(1.0, depth, out=np.zeros_like(depth), where=there)
    steps = np.maximum(np.round(inverse / inverse.max() * 255), 1)
    found = {
        "as it is": depth,
        "half": np.minimum(depth, 6e4).astype(np.float16).astype(np.float32),
        "8 bits": np.round(depth / most * 255) * most / 255,
        "8 bits, inverse": 255 / inverse.max() / steps,
        "millimetres": np.round(depth * 1000) / 1000,
        "decimetres": np.round(depth * 10) / 10,
    }
    return {name: np.where(there, plane, 0.0).astype(np.float32) for name, plane in found.items()}


def synthetic(height: int) -> dict[str, Depth]:
    """Surfaces along the axes, round ones, and none."""
    w = directions(2 * height, height)
    x, y, z = np.moveaxis(w, -1, 0)
    with np.errstate(divide="ignore"):
        shapes = {
            "constant": np.full(y.shape, 2.0),
            "room": room(height),
            "cube": 1.0 / np.abs(w).max(-1),
            "cylinder": np.minimum(2.0 / np.hypot(x, z), 1.5 / np.abs(y)),
            "floor": np.where(y < 0.0, -1.5 / y, 0.0),
            "wall": np.where(z < 0.0, -1.5 / z, np.inf),
        }
    for name, centre in (("ball", [0.0, 0.0, -2.0]), ("ball aside", [1.0, -1.0, -2.0])):
        ahead = w @ centre
        inside = ahead**2 - (np.dot(centre, centre) - 1.0)
        hit = (inside > 0.0) & (ahead > 0.0)
        shapes[name] = np.where(hit, ahead - np.sqrt(np.maximum(inside, 0.0)), 4.0)
    return {name: depth.astype(np.float32) for name, depth in shapes.items()}


@pytest.mark.parametrize("height", [16, 33, 64, 256])
def test_synthetic_depth_has_a_resolution_of_its_own(height: int) -> None:
    for name, depth in synthetic(height).items():
        for how, stored in quantised(depth).items():
            assert Grid.of(stored) is None, f"{name}, {how}"


def stepped(down: NDArray[np.bool_], across: NDArray[np.bool_]) -> Depth:
    """Depth that changes only at these rows (H,) and at these columns (W,)."""
    return np.asarray(1.0 + 0.01 * (down.cumsum()[:, None] + across.cumsum()), np.float32)


def some(size: int, factor: int, share: float) -> NDArray[np.bool_]:
    """(size,) a share of the borders between coarse texels, at random."""
    borders = np.arange(factor, size, factor)
    steps = np.zeros(size, bool)
    chosen = np.random.default_rng(1).permutation(borders)[: round(share * len(borders))]
    steps[chosen] = True
    return steps


@pytest.mark.parametrize(("rows", "is_grid"), [(8, False), (12, False), (16, True), (24, True)])
def test_few_rows_of_texels_could_be_any_pattern(rows: int, is_grid: bool) -> None:
    """Panels of a wall are as regular as the texels of a tiny picture of depth."""
    factor = 4
    panels = np.random.default_rng(1).uniform(1.0, 2.0, (rows, 2 * rows))
    grid = Grid.of(repeated(panels, factor * rows))
    assert (None if grid is None else grid.size) == ((2 * rows, rows) if is_grid else None)


@pytest.mark.parametrize(
    ("down", "across", "is_grid"),
    [(0.4, 0.4, True), (0.25, 0.25, False), (0.15, 1.0, False), (1.0, 0.15, False)],
)
def test_depth_changes_at_many_borders_of_texels(down: float, across: float, is_grid: bool) -> None:
    """Quantised depth does at a part of them; a few steps in a row are the surface's own."""
    height, factor = 512, 4
    grid = Grid.of(stepped(some(height, factor, down), some(2 * height, factor, across)))
    assert (None if grid is None else grid.size) == ((256, 128) if is_grid else None)


def test_steps_that_lie_on_a_grid_by_chance_are_none() -> None:
    """Columns are repeated and rows are not: some of 2,000 random sets of seven are all even."""
    rng = np.random.default_rng(1)
    across = some(64, 2, 1.0)
    even = 0
    for _ in range(2000):
        rows = 1 + rng.permutation(31)[:7]
        even += not (rows % 2).any()
        assert Grid.of(stepped(np.isin(np.arange(32), rows), across)) is None
    assert even


def write_coarse_scene(folder: Path, depth: Depth) -> Path:
    """A room of 256 x 128 with a cube of 40 cm on its floor."""
    placed = OBJECT.replace("1, 0, 0, 0, 0, 1, 0, 0,", "0.2, 0, 0, 0.1, 0, 0.2, 0, -1.1,")
    placed = placed.replace("0, 0, 1, 0, 0, 0, 0, 1]", "0, 0, 0.2, -0.9, 0, 0, 0, 1]")
    write_scene(folder, MANIFEST + placed, width=256)
    write_channels(folder / "depth.exr", Z=depth)
    return folder


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["repeated", "smaller", "both"])
def test_a_scene_with_coarse_depth(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    small = room(32)
    stored = {"repeated": repeated(small, 128), "smaller": small, "both": repeated(small, 64)}[kind]
    folder = write_coarse_scene(tmp_path / "own", stored)
    frame = Scene.open(folder).frame()
    _, normal = box_room(256, 128)
    away = ~near_edges(128, 14)
    assert np.abs(frame.depth / room(128) - 1.0)[away].max() < 1e-5
    assert ((frame.fitted_normal * normal).sum(-1) > 0.999)[away].all()
    assert cli.main(["scene", "check", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "floats" not in said
    assert "sinks" not in said
    assert "box: fine" in said
    assert "note: video.depth: depth.exr" in said
    assert "interpolated along surfaces" in said
    if kind != "smaller":
        assert "enlarged from 64 x 32" in said
    assert cli.main(["scene", "info", str(folder)]) == 0
    assert "interpolated along surfaces" in capsys.readouterr().out
    words = ["--size", "16", "16", "--accumulate", "1", "-o", str(tmp_path / "a.png")]
    assert cli.main(["render", str(folder), *words]) == 0
    assert caplog.text.count("interpolated along surfaces") == 1


def test_every_frame_of_a_video(tmp_path: Path) -> None:
    """What is found in the first frame holds wherever reading begins; bad frames change nothing."""
    codes = [np.round(repeated(room(16), 64) * 1000 + 40 * i).astype(int) for i in range(4)]
    colors = [plain(60, 128, 64) for _ in range(4)]
    write_video(tmp_path / "clip.mkv", Track("ffv1", "yuv444p", colors), grey16(codes))
    text = 'format = 1\nname = "clip"\n[video]\ncolor = "clip.mkv"\ndepth_scale = 0.001\n'
    (tmp_path / "scene.toml").write_text(text)
    for index in (3, 0, 1):
        frame = Scene.open(tmp_path).frame(index)
        away = ~near_edges(64, 14)
        assert np.abs(frame.depth - room(64) - 0.04 * index)[away].max() < 0.02
        assert np.unique(frame.depth[40]).size > 40, "no steps"


@pytest.mark.parametrize("shape", [(64, 100), (256, 512), (128, 128)])
def test_depth_that_does_not_fit(
    shape: tuple[int, int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_coarse_scene(tmp_path / "own", np.full(shape, 2.0, np.float32))
    assert cli.main(["scene", "check", str(folder)]) == 2
    assert "a smaller one twice as wide as high" in capsys.readouterr().err
