"""Tables of tone curves against the curves themselves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from iprt.output.display import Curve, developed, display, level

EXPOSURES = (1e-30, 1e-3, 0.7, 1.0, 3.7, 1e6)


def around_steps(exposure: float, curve: Curve) -> np.ndarray:
    """Radiance just below, at and just above each value at which the level changes."""
    spread = np.geomspace(1e-9, 1e9, 4001).astype(np.float32)
    levels = np.rint(level(spread, exposure, curve))
    near = spread[1:][np.diff(levels) > 0]
    steps = np.arange(-300, 301, dtype=np.int32)
    bits = near.view(np.int32)[:, None] + steps
    return np.maximum(bits, 0).view(np.float32)


@pytest.mark.parametrize("curve", ["srgb", "filmic"])
@pytest.mark.parametrize("exposure", EXPOSURES)
def test_tables_give_the_curve_to_the_bit(exposure: float, curve: Curve) -> None:
    ends = np.float32([0.0, -0.0, -1.0, 1e-45, 1e38, np.inf, -np.inf])
    for radiance in (ends, around_steps(exposure, curve), np.linspace(0, 2, 99991, dtype="f4")):
        with np.errstate(invalid="ignore"):
            expected = np.rint(np.nan_to_num(level(radiance, exposure, curve)))
        np.testing.assert_array_equal(developed(radiance, exposure, curve), expected)


@settings(max_examples=50)
@given(st.lists(st.floats(0.0, 3.0, width=32), min_size=3, max_size=60), st.floats(0.01, 50.0))
def test_a_window_shows_what_a_file_holds(values: list[float], exposure: float) -> None:
    picture = np.resize(np.float32(values), (4, 5, 3))
    expected = np.rint(255.0 * display(picture, exposure))
    np.testing.assert_array_equal(developed(picture, exposure), expected)


def test_nan_is_seen() -> None:
    bits = np.array([0x7FC00000, 0x7FFFFFFF, 0x7F800001], np.int32)
    assert (developed(bits.view(np.float32)) == 255).all()


def test_filmic_presses_highlights_and_stays_in_order() -> None:
    radiance = np.geomspace(1e-4, 1e4, 5000).astype(np.float32)
    shown = developed(radiance, 1.0, "filmic").astype(int)
    assert (np.diff(shown) >= 0).all()
    clipped = developed(radiance)
    assert shown[radiance > 1.2].min() < 255, "bright parts keep their differences"
    assert (clipped[radiance > 1.0] == 255).all()
    # Narkowicz's fit: 0.18 becomes (0.18 * (2.51 * 0.18 + 0.03)) / (0.18 * (2.43 * 0.18 + 0.59)
    # + 0.14) = 0.26690, which sRGB shows as 141.13.
    assert developed(np.float32([0.18]), 1.0, "filmic")[0] == 141
