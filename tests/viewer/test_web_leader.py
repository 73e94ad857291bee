"""Distinction of a user's turns from a browser's answers, and letterboxed pictures."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("viser")

from iprt.geometry.camera import View
from iprt.viewer.web.leader import AGAIN_S, SETTLE_S, Leader
from iprt.viewer.web.picture import letterboxed

AHEAD = View(64, 48)


def yawed(degrees: float, fov: float = 60.0) -> View:
    return replace(AHEAD, yaw_deg=degrees, fov_y_deg=fov)


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    clock = SimpleNamespace(s=100.0)
    monkeypatch.setattr("iprt.viewer.web.leader.time.monotonic", lambda: clock.s)
    return clock


@pytest.fixture
def leader(now: SimpleNamespace) -> Leader:
    """Has led to a view, which the browser reached."""
    camera = SimpleNamespace(fov=1.0)
    found = Leader(SimpleNamespace(camera=camera, atomic=nullcontext), AHEAD)
    found.lead(yawed(10.0))
    assert not found.heard(yawed(10.0))
    return found


def test_a_camera_at_rest_is_its_users(leader: Leader) -> None:
    assert leader.heard(yawed(3.0))


def test_a_chosen_view_is_sent_until_it_is_reached(leader: Leader, now: SimpleNamespace) -> None:
    """A page that is still being made has a camera of its own."""
    leader.lead(yawed(40.0, 30.0))
    camera = leader._client.camera
    camera.fov = None
    assert not leader.heard(yawed(10.0))
    assert camera.fov is None
    now.s += 1.1 * AGAIN_S
    assert not leader.heard(yawed(-90.0))
    assert camera.fov == pytest.approx(np.deg2rad(30.0))
    now.s += SETTLE_S
    assert leader.heard(yawed(-90.0))


def test_a_motion_is_left_where_the_user_turns(leader: Leader) -> None:
    for step in range(1, 6):
        leader.lead(yawed(10.0 + step, 60.0 - step), moving=True)
    assert not leader.heard(yawed(12.0, 58.0)), "an answer on the way"
    assert not leader.heard(yawed(12.0, 57.0)), "the field of view is ahead"
    assert leader.waits
    assert leader.heard(yawed(12.5, 58.0))
    assert not leader.waits


@pytest.mark.parametrize(("width", "beside"), [(40, 6), (48, 2), (49, 0), (50, 0), (60, 0)])
def test_narrower_pictures_get_black_columns(width: int, beside: int) -> None:
    """Beyond the window's 50 columns, so that nothing else is seen; none for half a pixel."""
    pixels = np.full((20, width, 3), 9, np.uint8)
    found = letterboxed(pixels, 50.0 / 20.0)
    assert found.shape == (20, width + 2 * beside, 3)
    assert np.array_equal(found[:, beside : beside + width], pixels)
    assert not found[:, :beside].any()
    assert not found[:, beside + width :].any()
