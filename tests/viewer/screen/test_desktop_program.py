"""A program controls a window, from a thread of its own."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from iprt.errors import IprtError
from iprt.viewer.program.control import Control
from tests.viewer.screen.user import FRAMES, User


def test_the_window_follows_a_program(user: User) -> None:
    control = Control(user.engine, user.app)

    def does(act: Callable[[], object]) -> object:
        with ThreadPoolExecutor(1) as pool:
            done = pool.submit(act)
            user.until(done.done)
        return done.result()

    view, before = user.ui.viewport.view, user.at_rest()
    does(lambda: control.look(yaw=view.yaw_deg + 5.0))
    assert user.ui.viewport.view.yaw_deg == pytest.approx(view.yaw_deg + 5.0)
    does(lambda: control.display(exposure=1.0))
    assert user.ui.viewport.lens.exposure_ev == 1.0
    shown = user.at_rest()
    assert np.abs(shown.picture.color - before.picture.color).max() > 0.01
    picture = does(lambda: control.picture(frames=FRAMES))
    assert np.shape(picture) == (view.height, view.width, 3)
    does(lambda: control.remove("cube"))
    with pytest.raises(IprtError, match="edits are not saved: cube"):
        does(control.quit)
    assert not user.app.closed


def test_a_program_closes_the_window(user: User) -> None:
    """Without a question, as edits are to be discarded."""
    user.engine.editor.remove(["cube"])
    Control(user.engine, user.app).quit(discard=True)
    user.until(lambda: user.app.window.closing)
    assert user.app.closed
    user.app.window.closing = user.app._discarding = False
