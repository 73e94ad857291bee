"""The browser's plot of times: lines are those of passes that ran in the frames it shows."""

from __future__ import annotations

from unittest.mock import Mock

import numpy as np
import pytest

from iprt.device.profile import PassTime
from iprt.viewer.pass_times import MOST_FRAMES
from iprt.viewer.session import Shown

pytest.importorskip("viser", reason="needs the extra `view`: ./run screen")

from iprt.viewer.web import profile_panel


def test_passes_that_ran_no_more_lose_their_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five passes, then three of them with two others, until the window holds only these."""
    monkeypatch.setattr(profile_panel, "EVERY_S", 0.0)
    browser = Mock()
    panel = profile_panel.ProfilePanel(browser)
    plot = browser.client.gui.add_uplot.return_value
    for step in range(3 * MOST_FRAMES):
        names = "abcde" if step < MOST_FRAMES else "cdefg"
        passes = tuple(PassTime(name, 1.0 + step, 0.0, 1) for name in names)
        browser.displayed.shown = Mock(Shown, step=step, passes=passes, seconds=0.1)
        panel.sync()
        labels = [line["label"] for line in plot.series[3:]]
        assert len(labels) == len(set(labels)) == profile_panel.MOST_PASSES
        assert len(plot.data) == len(plot.series)
        for times in plot.data[3:]:
            assert times[-1] in (0.0, 1.0 + step)
    assert set(labels) <= set("cdefg")
    assert np.array_equal(plot.data[0], np.arange(2 * MOST_FRAMES, 3 * MOST_FRAMES))
