"""Snapshots, distributions and pinned pixels tell what the pictures hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.viewer.actions import actions
from iprt.viewer.controls import with_value
from iprt.viewer.distribution import BINS, distribution
from iprt.viewer.lens import CUBEHELIX, Lens
from iprt.viewer.looking import MOST_PINS, flipped, pin, pinned
from iprt.viewer.looking_fields import range_fields
from tests.viewer.viewports import Ui, at_rest, until


def show(ui: Ui) -> np.ndarray:
    """The pixels of the picture at rest, which the window then displays."""
    number = ui.engine._shared._world_number
    until(ui.viewport, lambda displayed: displayed.shown.number >= number)
    ui.displayed = at_rest(ui.viewport)
    return ui.displayed.pixels


def test_two_states_are_compared(ui: Ui) -> None:
    """On both sides of the bar, by flipping, and as a score."""
    do = actions(ui)
    assert not do["flip"].enabled()
    red = show(ui)
    do["snapshot"].act()
    ui.selection.paint(albedo=(0.0, 0.1, 0.9))
    blue = show(ui)
    assert not np.array_equal(red, blue)
    do["flip"].act()
    assert flipped(ui)
    np.testing.assert_array_equal(show(ui), red)
    do["flip"].act()
    np.testing.assert_array_equal(show(ui), blue)
    ui.viewport.lens = replace(ui.viewport.lens, against="snapshot", split=0.5)
    both, column = show(ui), red.shape[1] // 2
    np.testing.assert_array_equal(both[:, :column], blue[:, :column])
    np.testing.assert_array_equal(both[:, column:], red[:, column:])
    scored = until(ui.viewport, lambda shown: "SSIM" in shown.caption)
    assert 0.0 < float(scored.caption.rpartition(" ")[2]) < 1.0


def test_a_snapshot_of_another_view_or_frame_is_not_compared(ui: Ui) -> None:
    do = actions(ui)
    show(ui)
    do["snapshot"].act()
    ui.viewport.turn(5.0, 0.0)
    do["flip"].act()
    show(ui)
    assert ui.displayed is not None
    assert "shows another view" in ui.displayed.caption


def test_buffers_of_snapshots_are_compared_if_they_have_them(ui: Ui) -> None:
    do = actions(ui)
    ui.viewport.lens = replace(ui.viewport.lens, buffer="albedo")
    before = show(ui)
    do["snapshot"].act()
    ui.selection.paint(albedo=(0.0, 0.1, 0.9))
    do["flip"].act()
    np.testing.assert_array_equal(show(ui), before)
    ui.viewport.lens = replace(ui.viewport.lens, buffer="normal")
    show(ui)
    assert ui.displayed is not None
    assert "does not have it" in ui.displayed.caption


def test_the_state_of_a_snapshot_comes_back(ui: Ui) -> None:
    do = actions(ui)
    red = show(ui)
    settings, world = ui.settings, ui.engine.world
    do["snapshot"].act()
    ui.selection.paint(albedo=(0.0, 0.1, 0.9))
    ui.settings = with_value(ui.settings, "trace.rays", 3)
    blue = show(ui)
    do["back to snapshot"].act()
    assert ui.settings == settings
    assert ui.engine.world.edits == world.edits
    np.testing.assert_allclose(show(ui).astype(int), red, atol=2)
    do["undo"].act()
    ui.settings = with_value(ui.settings, "trace.rays", 3)
    assert np.abs(show(ui).astype(int) - blue).mean() < 2.0


def test_histograms_count_all_known_pixels() -> None:
    values = np.random.default_rng(0).gamma(2.0, 3.0, (40, 50)).astype(np.float32)
    values[0, :5] = np.inf
    found = distribution(Lens(), "depth", values, 1.0)
    assert found is not None
    known = values[np.isfinite(values)]
    low, high = np.percentile(known, (1.0, 99.0))
    assert (found.low, found.high) == pytest.approx((low, high))
    expected = np.histogram(known, BINS, (found.low, found.high))[0]
    np.testing.assert_array_equal(found.counts[1:-1], expected[1:-1])
    assert found.counts.sum() == known.size
    assert found.scaled


@pytest.mark.parametrize("name", ["depth", "variance", "coverage"])
def test_the_color_bar_has_the_colors_of_the_picture(name: str) -> None:
    """Of a picture with the values of the bins' middles, whatever else it holds."""
    values = np.linspace(0.0 if name != "depth" else 0.5, 1.0, 101, dtype=np.float32)[None]
    found = distribution(Lens(), name, values, 1.0)
    assert found is not None
    middles = found.low + (found.high - found.low) * (np.arange(BINS) + 0.5) / BINS
    ranged = Lens(low=found.low, high=found.high) if found.scaled else Lens()
    expected = ranged.color(name, middles[None].astype(np.float32), 1.0)[0]
    np.testing.assert_array_equal(found.colors, expected)
    assert len(np.unique(found.colors, axis=0)) > BINS // 2


def test_a_picture_is_counted_in_stops_of_luminance() -> None:
    """A grey one of an eighth of white is three stops below it, at any exposure."""
    grey = np.full((4, 4, 3), 0.125, np.float32)
    for exposure in (1.0, 2.0):
        found = distribution(Lens(), None, grey / np.float32(exposure), exposure)
        assert found is not None
        (number,) = np.flatnonzero(found.counts)
        width = (found.high - found.low) / BINS
        assert abs(found.low + (number + 0.5) * width + 3.0) <= width
        assert found.counts[number] == 16


def test_values_without_an_order_have_no_histogram() -> None:
    for name in ("normal", "motion", "tracing_level"):
        assert distribution(Lens(), name, np.zeros((4, 4, 3), np.float32), 1.0) is None


def test_a_chosen_range_is_that_of_the_colors(ui: Ui) -> None:
    ui.viewport.lens = replace(ui.viewport.lens, buffer="depth")
    show(ui)
    low, high = range_fields(ui)
    assert low.enabled()
    assert 0.0 < low.read() < high.read()
    low.write(1.0)
    high.write(1.5)
    pixels = show(ui)
    assert (low.read(), high.read()) == (1.0, 1.5)
    assert ui.displayed is not None
    depth = ui.displayed.shown.picture.aovs["depth"].squeeze()
    assert (pixels[depth <= 1.0] == CUBEHELIX[-1]).all()
    far = pixels[np.isfinite(depth) & (depth > 1.5)]
    assert (far == CUBEHELIX[25]).all()
    do = actions(ui)
    assert do["auto range"].visible()
    do["auto range"].act()
    show(ui)
    assert high.read() > 1.5
    high.write(2.0)
    ui.viewport.lens = replace(ui.viewport.lens, buffer="albedo", low=None, high=None)
    show(ui)
    assert not low.enabled()


def test_pinned_pixels_keep_their_place(ui: Ui) -> None:
    show(ui)
    assert ui.displayed is not None
    for column in range(MOST_PINS + 2):
        pin(ui, (column + 0.5) / 48.0, 0.5)
    found = pinned(ui)
    assert len(found) == MOST_PINS
    color = ui.displayed.shown.picture.color
    for values in found:
        np.testing.assert_array_equal(values.radiance, color[values.y, values.x])
    ui.selection.paint(albedo=(0.0, 0.1, 0.9))
    show(ui)
    assert [values.x for values in pinned(ui)] == [values.x for values in found]
    actions(ui)["unpin"].act()
    assert pinned(ui) == []


def test_exposure_and_curve_by_keys(ui: Ui) -> None:
    do = actions(ui)
    for _ in range(3):
        do["brighter"].act()
    do["darker"].act()
    assert ui.viewport.lens.exposure_ev == 1.0
    for _ in range(40):
        do["darker"].act()
    assert ui.viewport.lens.exposure_ev == -8.0
    do["reset exposure"].act()
    assert ui.viewport.lens.exposure_ev == 0.0
    do["flip curve"].act()
    assert ui.viewport.lens.curve == "filmic"
    do["flip curve"].act()
    assert ui.viewport.lens.curve == "srgb"


def test_pictures_in_motion_are_not_counted(ui: Ui, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each takes milliseconds of the interface's thread; the histogram at rest stays."""
    show(ui)
    counted = ui.distribution
    assert ui.displayed is not None
    moving = replace(ui.displayed.shown, frames=0)
    assert not moving.refined
    ui.displayed = replace(ui.displayed, shown=moving)
    monkeypatch.setattr("iprt.viewer.ui_state.distribution", lambda *_: pytest.fail("counted"))
    assert ui.distribution is counted
    monkeypatch.undo()
    ui.displayed = replace(ui.displayed, shown=replace(moving, frames=moving.request.frames))
    assert ui.distribution is not counted
