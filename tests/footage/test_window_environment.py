"""What lies behind windows: what they show stays, the rest is extrapolated from it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from iprt.footage.sky import OUTSIDE_ROWS
from iprt.footage.window_environment import outside_radiance
from iprt.geometry.equirect import solid_angles

ROWS, COLUMNS = OUTSIDE_ROWS, 2 * OUTSIDE_ROWS
Image = NDArray[np.float32]
Mask = NDArray[np.bool_]


def random_colors(width: int = COLUMNS, height: int = ROWS) -> Image:
    return np.random.default_rng(3).uniform(0.1, 5.0, (height, width, 3)).astype(np.float32)


def window(row: int, column: int, rows: int, columns: int, scale: int = 1) -> Mask:
    """A rectangle of cells; a cell is `scale` x `scale` texels. It may lie across the seam."""
    mask = np.zeros((ROWS, COLUMNS), bool)
    mask[row : row + rows, np.arange(column, column + columns) % COLUMNS] = True
    return np.asarray(mask.repeat(scale, axis=0).repeat(scale, axis=1))


WINDOWS = {
    "one texel": window(64, 100, 1, 1),
    "ordinary": window(40, 60, 30, 20),
    "across the seam": window(50, 250, 20, 17),
    "at a pole": window(0, 30, 9, 40),
    "two": window(45, 20, 31, 13) | window(70, 150, 9, 31),
    "everywhere": window(0, 0, ROWS, COLUMNS),
    "scattered": np.random.default_rng(1).random((ROWS, COLUMNS)) < 0.01,
}
windows = pytest.mark.parametrize("opening", WINDOWS.values(), ids=WINDOWS)


@windows
def test_what_windows_show_stays(opening: Mask) -> None:
    color = random_colors()
    outside = outside_radiance(color[opening], opening)
    assert outside.shape == (ROWS, COLUMNS, 3)
    assert outside.dtype == np.float32
    np.testing.assert_allclose(outside[opening], color[opening], rtol=1e-6)


@windows
def test_constant_light_is_constant_all_around(opening: Mask) -> None:
    """Also: what is no window does not count."""
    color = random_colors()
    color[opening] = (3.0, 0.5, 0.0)
    outside = outside_radiance(color[opening], opening)
    np.testing.assert_allclose(outside, np.broadcast_to((3.0, 0.5, 0.0), outside.shape), rtol=1e-6)


@windows
@pytest.mark.parametrize("peak", [1e-6, 1.0, 1e6])
def test_extrapolation_invents_no_light(opening: Mask, peak: float) -> None:
    """Everything is a mean of what windows show: between their least and their most light."""
    color = (peak * random_colors() ** 4).astype(np.float32)
    outside = outside_radiance(color[opening], opening)
    assert np.isfinite(outside).all()
    low, high = color[opening].min(0), color[opening].max(0)
    assert (outside >= low * (1.0 - 1e-6)).all()
    assert (outside <= high * (1.0 + 1e-6)).all()


@pytest.mark.parametrize("scale", [2, 3])
def test_fine_panoramas_keep_their_flux(scale: int) -> None:
    """A cell is the mean of its texels by solid angle, so windows send as much as they show."""
    opening = window(20, 60, 50, 20, scale) | window(0, 5, 6, 30, scale)
    height, width = opening.shape
    color = random_colors(width, height)
    outside = outside_radiance(color[opening], opening)
    sr = np.broadcast_to(solid_angles(width, height)[:, None], (height, width))

    def per_cell(image: NDArray[np.generic]) -> NDArray[np.float64]:
        cells = image.astype(np.float64).reshape(ROWS, scale, COLUMNS, scale, -1)
        return np.asarray(cells.sum((1, 3)))

    covered = per_cell(opening)[..., 0] > 0.0
    flux = per_cell(color * sr[..., None])
    np.testing.assert_allclose(outside[covered], (flux / per_cell(sr))[covered], rtol=1e-3)
    cells = solid_angles(COLUMNS, ROWS)[:, None, None]
    np.testing.assert_allclose(
        (outside * cells)[covered].sum(0), (color * sr[..., None])[opening].sum(0), rtol=1e-4
    )


@pytest.mark.parametrize("size", [(2, 1), (30, 15), (64, 32), (300, 150), (509, 255)], ids=str)
def test_panoramas_of_any_size(size: tuple[int, int]) -> None:
    """A gradient that a window shows is found again where the window is."""
    width, height = size
    row = np.arange(height)[:, None] / height + np.zeros((height, width))
    column = np.arange(width) / width + np.zeros((height, width))
    opening = (row >= 0.3) & (row < 0.7) & (column >= 0.2) & (column < 0.6)
    opening[height // 2, width // 2] = True
    color = np.stack([row, column, np.ones_like(row)], -1).astype(np.float32)
    outside = outside_radiance(color[opening], opening)
    assert np.isfinite(outside).all()
    np.testing.assert_allclose(outside[..., 2], 1.0, rtol=1e-6)
    if height > 15:
        at = np.stack(np.nonzero(opening), -1) / [height, width]
        cells = np.floor(at * [ROWS, COLUMNS] + 1e-9).astype(int)
        shown = outside[cells[:, 0], cells[:, 1], :2]
        np.testing.assert_allclose(shown, at, atol=1.0 / min(ROWS, height))


def test_the_nearer_window_is_seen_more() -> None:
    red, blue = window(54, 20, 20, 20), window(54, 148, 20, 20)
    color = np.zeros((ROWS, COLUMNS, 3), np.float32)
    color[red, 0] = color[blue, 2] = 1.0
    outside = outside_radiance(color[red | blue], red | blue)
    horizon = outside[ROWS // 2]
    np.testing.assert_allclose(horizon.sum(-1), 1.0, atol=1e-5)
    assert (horizon[[250, 10, 45, 60], 0] > 0.6).all()
    assert (horizon[[122, 138, 173, 188], 2] > 0.6).all()
    # Half way, on both sides, one of them across the seam: both.
    assert (np.abs(horizon[[94, 222]] - [0.5, 0.0, 0.5]) < 0.25).all()


def test_extrapolation_has_no_steps() -> None:
    """Nothing in reflections tells where a cell of a coarse level ends, nor where the seam is."""
    red, blue = window(56, 30, 16, 8), window(56, 158, 16, 8)
    color = np.zeros((ROWS, COLUMNS, 3), np.float32)
    color[red, 0] = color[blue, 2] = 1.0
    opening = red | blue
    outside = outside_radiance(color[opening], opening)
    away = ~ndimage.binary_dilation(opening, iterations=8)
    across = np.abs(outside - np.roll(outside, 1, 1)).max(-1)
    down = np.abs(np.diff(outside, axis=0)).max(-1)
    assert across[away].max() < 0.05
    # Elevations that a window showed may differ from others, as at the horizon.
    assert down[away[1:] & away[:-1]].max() < 0.3


def test_elevation_tells_more_than_azimuth() -> None:
    """Behind the camera, ground and sky are what a window in front showed of them."""
    opening = window(44, 20, 40, 20)
    color = np.zeros((ROWS, COLUMNS, 3), np.float32)
    color[: ROWS // 2, :, 2] = 1.0
    color[ROWS // 2 :, :, 0] = 1.0
    behind = outside_radiance(color[opening], opening)[:, 20 + COLUMNS // 2]
    assert (behind[46:56, 2] > 0.9).all()
    assert (behind[72:82, 0] > 0.9).all()


@windows
def test_symmetries(opening: Mask) -> None:
    """Half a turn, reflections and a change of unit do to the result what they do to the input."""
    color = random_colors()
    outside = outside_radiance(color[opening], opening)

    def same(moved_color: Image, moved_opening: Mask, wanted: Image) -> None:
        found = outside_radiance(moved_color[moved_opening], moved_opening)
        np.testing.assert_allclose(found, wanted, rtol=1e-5)

    half = COLUMNS // 2
    same(np.roll(color, half, 1), np.roll(opening, half, 1), np.roll(outside, half, 1))
    same(color[:, ::-1], opening[:, ::-1], outside[:, ::-1])
    same(color[::-1], opening[::-1], outside[::-1])
    same(color[..., ::-1], opening, outside[..., ::-1])
    np.testing.assert_array_equal(outside_radiance(64.0 * color[opening], opening), 64.0 * outside)
