"""Exposure, false colors and comparisons, without a device."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.viewer.lens import BUFFERS, ERROR_LEVELS, Lens, error_map

RNG = np.random.default_rng(4)


@pytest.mark.parametrize("name", BUFFERS)
@pytest.mark.parametrize("fill", ["noise", "nothing", "extremes"])
def test_any_buffer_becomes_a_picture(name: str, fill: str) -> None:
    """Scalars and vectors do, empty ones (a scene without such a pass) and infinite ones too."""
    shapes = {"distance": [(6, 8)], "label": [(6, 8)], "count": [(6, 8)], "motion": [(6, 8, 2)]}
    for shape in shapes.get(BUFFERS[name].appearance, [(6, 8), (6, 8, 3)]):
        values = np.zeros(shape, np.float32)
        if fill == "noise":
            values = RNG.normal(size=shape).astype(np.float32)
        elif fill == "extremes":
            values = RNG.choice(np.float32([np.inf, -np.inf, np.nan, 1e38, -1e9, 0.0]), shape)
        with np.errstate(all="ignore"):
            shown = Lens().color(name, values, 1.0)
        assert shown.dtype == np.uint8
        assert shown.shape == (6, 8, 3)


def test_stops_double() -> None:
    radiance = RNG.uniform(0.0, 0.4, (5, 7, 3)).astype(np.float32)
    brighter = Lens(exposure_ev=1.0).develop(radiance, 0.5)
    np.testing.assert_array_equal(brighter, Lens().develop(2.0 * radiance, 0.5))
    np.testing.assert_array_equal(brighter, Lens(exposure_ev=-1.0).develop(radiance, 2.0))


def test_split_shows_each_side_of_its_own() -> None:
    ours, other = np.zeros((4, 10, 3), np.uint8), np.full((4, 10, 3), 9, np.uint8)
    for split, column in ((0.0, 0), (0.3, 3), (1.0, 10), (-1.0, 0), (7.0, 10)):
        both = Lens(against="ibl", split=split).compare(ours, other)
        assert (both[:, :column] == 0).all()
        assert (both[:, column:] == 9).all()
    assert (ours == 0).all()


def test_error_map_is_symmetric_and_grows_with_the_error() -> None:
    a = RNG.integers(0, 256, (8, 8, 3)).astype(np.uint8)
    b = RNG.integers(0, 256, (8, 8, 3)).astype(np.uint8)
    np.testing.assert_array_equal(error_map(a, b), error_map(b, a))
    assert (error_map(a, a) == 0).all()
    gray = np.full((1, ERROR_LEVELS + 1, 3), 100, np.uint8)
    other = gray + np.arange(ERROR_LEVELS + 1, dtype=np.uint8)[None, :, None]
    luminance = error_map(gray, other).astype(float) @ [0.30, 0.59, 0.11]
    assert (np.diff(luminance[0]) > 0).all()
    assert (error_map(gray, other)[0, -1] == 255).all()


def test_near_is_brighter_than_far_and_sky_is_black() -> None:
    depth = np.float32([[1.0, 2.0, 4.0, 8.0, np.inf]])
    shown = Lens().color("depth", depth, 1.0).astype(float) @ [0.30, 0.59, 0.11]
    assert (np.diff(shown[0]) < 0).all()
    assert shown[0, -1] == 0.0


def test_motion_tells_directions_apart() -> None:
    motion = np.float32([[[0, 0], [16, 0], [-16, 0], [0, 16], [-1e9, -1e9]]])
    shown = Lens().color("motion", motion, 1.0)[0]
    np.testing.assert_array_equal(shown[0], (128, 128, 128))
    assert shown[1, 0] == 255
    assert shown[2, 0] == 0
    assert shown[3, 1] == 255
    np.testing.assert_array_equal(shown[4], (0, 0, 255))
