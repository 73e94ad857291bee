"""Times of the last view frames: as they were measured, no more than are kept."""

from __future__ import annotations

from unittest.mock import Mock

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.device.profile import PassTime
from iprt.scene.scene import Scene
from iprt.viewer.pass_times import MOST_FRAMES, PassTimes
from iprt.viewer.session import Shown
from tests.clips import write_clip
from tests.viewer.turns import turns


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
        assert rows[name].median_ms == pytest.approx(np.median(values))
        assert rows[name].p95_ms == pytest.approx(np.quantile(values, 0.95))
        assert rows[name].share == pytest.approx(values.sum() / whole.sum())


def test_times_of_a_client(tmp_path_factory: pytest.TempPathFactory, device: ComputeDevice) -> None:
    """Each frame on its own: host and device, which may work at once, took no longer than all."""
    scene = Scene.open(write_clip(tmp_path_factory.mktemp("clip"), 1))
    pass_times = PassTimes()
    with turns(scene, device) as driver:
        client = driver.join(frames=5)
        driver.answer(client)
        for _ in range(4):
            pass_times.add(driver.shown(client))
            driver.core.turn()
        pass_times.add(driver.shown(client))
    assert list(pass_times.steps) == [1, 2, 3, 4, 5]
    assert {"composite", "temporal"} <= pass_times.series().keys()
    whole = np.sum(list(pass_times.series().values()), axis=0)
    assert (whole > 0.0).all()
    assert (whole <= 2.0 * pass_times.wall_ms).all()
