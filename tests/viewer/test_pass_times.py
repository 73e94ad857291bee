"""Times of the last view frames: as they were measured, no more than are kept."""

from __future__ import annotations

from unittest.mock import Mock

import numpy as np
import pytest

from iprt.device.profile import PassTime
from iprt.viewer.pass_times import MOST_FRAMES, PassTimes
from iprt.viewer.session import Shown


def frame(step: int, **passes: float) -> Shown:
    times = tuple(PassTime(name, 0.75 * ms, 0.25 * ms, 1) for name, ms in passes.items())
    return Mock(Shown, step=step, passes=times, seconds=0.1)


def test_the_last_frames_are_kept() -> None:
    pass_times = PassTimes()
    assert pass_times.series() == {}
    assert pass_times.table() == []
    random = np.random.default_rng(0)
    march, blend = random.random((2, 3 * MOST_FRAMES)) + 0.5
    march *= 0.1
    for step, (one, two) in enumerate(zip(march, blend, strict=True)):
        shown = frame(step, march=one, **({"blend": two} if step % 2 else {}))
        assert pass_times.add(shown)
        assert not pass_times.add(frame(step, march=99.0)), "other buffers of the same frame"
    kept = slice(-MOST_FRAMES, None)
    assert np.array_equal(pass_times.steps, np.arange(3 * MOST_FRAMES)[kept])
    assert np.array_equal(pass_times.wall_ms, [100.0] * MOST_FRAMES)
    blend[::2] = 0.0
    series = pass_times.series()
    assert list(series) == ["march", "blend"]
    np.testing.assert_allclose(series["march"], march[kept])
    np.testing.assert_allclose(series["blend"], blend[kept])
    rows = {row.name: row for row in pass_times.table()}
    assert list(rows) == ["frame", "blend", "march"], "the longest first"
    whole = (march + blend)[kept]
    for name, values in (("march", march[kept]), ("blend", blend[kept]), ("frame", whole)):
        assert rows[name].mean_ms == pytest.approx(np.mean(values))
        assert rows[name].p95_ms == pytest.approx(np.quantile(values, 0.95))
        assert rows[name].share == pytest.approx(values.sum() / whole.sum())


def test_a_spike_does_not_flatten_the_plot() -> None:
    pass_times = PassTimes()
    for step in range(50):
        pass_times.add(frame(step, trace=1000.0 if step == 20 else 10.0, filter=2.0))
    assert pass_times.top_ms == pytest.approx(1.1 * 2.0 * 12.0)
    rows = {row.name: row for row in pass_times.table()}
    assert rows["trace"].mean_ms + rows["filter"].mean_ms == pytest.approx(rows["frame"].mean_ms)
    for row in rows.values():
        assert row.share == pytest.approx(row.mean_ms / rows["frame"].mean_ms)


def test_passes_that_ran_no_more_lose_their_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five passes, then three of them with two others, until the window holds only these."""
    pytest.importorskip("viser", reason="needs the extra `view`: ./run screen")
    from iprt.viewer.web import profile_panel

    monkeypatch.setattr(profile_panel, "EVERY_S", 0.0)
    browser = Mock()
    panel = profile_panel.ProfilePanel(browser)
    plot = browser.client.gui.add_uplot.return_value
    for step in range(3 * MOST_FRAMES):
        names = "abcde" if step < MOST_FRAMES else "cdefg"
        browser.displayed.shown = frame(step, **dict.fromkeys(names, 1.0 + step))
        panel.sync()
        labels = [line["label"] for line in plot.series[3:]]
        assert len(labels) == len(set(labels)) == profile_panel.MOST_PASSES
        assert len(plot.data) == len(plot.series)
        for times in plot.data[3:]:
            assert times[-1] in (0.0, 1.0 + step)
    assert set(labels) <= set("cdefg")
    assert np.array_equal(plot.data[0], np.arange(2 * MOST_FRAMES, 3 * MOST_FRAMES))
