"""Renders from the window, as one who sits before it orders and ends them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from PIL import Image

from iprt.geometry.material import Material
from tests.commands.test_faults import DEVICE
from tests.viewer.screen.user import FRAMES, SIZE, User


@pytest.fixture
def sitting(user: User, monkeypatch: pytest.MonkeyPatch) -> Iterator[User]:
    """With the tab of renders open, in a window that has room for all of it."""
    monkeypatch.setenv("IPRT_DEVICE", DEVICE)
    width, height = user.app.window.size
    user.app.window.size = width, 720
    user.until(lambda: user.app.window.size == (width, 720))
    user.at_rest()
    user.press("Scene")
    user.key("r", control=True)
    assert user.reads("Whole panorama")
    assert user.ui.mode == "move", "the key without Ctrl turns"
    yield user
    queue = user.engine.renders
    queue.cancel_all()
    for render in queue.renders:
        queue.forget(render.number)
    user.press("Scene")
    user.app.window.size = width, height
    user.until(lambda: user.app.picture_view.rectangle[2:] == SIZE)


def press_button(user: User, name: str) -> None:
    """Press the newest button of an action."""
    user.away()
    user.press(next(label for label in reversed(user.places) if label.partition("##")[2] == name))


def test_the_picture_is_rendered_as_it_is_seen(sitting: User) -> None:
    """With an edit that is not saved, and after a wrong name, which is told at once."""
    user, form = sitting, sitting.ui.render_form
    displayed = user.ui.displayed
    assert displayed is not None
    before = displayed.pixels
    user.engine.editor.paint({"cube": Material("plastic", (0.1, 0.6, 0.2), alpha=0.3)})
    view = user.at_rest().request.view
    form.resize(width=view.width)
    form.resize(height=view.height)
    form.accumulate = FRAMES
    form.file = "shot.gif"  # as if it was typed
    user.away()
    assert user.reads("unknown output format '.gif'")
    press_button(user, "render")
    assert user.reads("unknown output format '.gif'", "Nothing is rendered.")
    form.file = "shot.png"
    user.away()
    assert not user.reads("unknown output format")
    press_button(user, "render")
    user.until(lambda: not user.engine.renders.open)
    user.wait()
    path = user.folder / "Pictures" / "iprt" / "shot.png"
    assert user.reads("shot.png", f"written: {path}")
    assert user.ui.displayed is not None
    pixels, seen = np.asarray(Image.open(path)).astype(float), user.ui.displayed.pixels
    assert np.abs(pixels - seen).mean() < 0.2 * np.abs(pixels - before).mean()
    assert user.engine.unsaved == ("cube",)
    press_button(user, f"dismiss {user.engine.renders.renders[0].number}")
    user.wait()
    assert user.reads("Nothing is rendered.")
    assert path.exists()


def test_closing_asks_about_renders(sitting: User) -> None:
    user, form = sitting, sitting.ui.render_form
    form.what = "clip"
    form.accumulate = 100_000
    press_button(user, "render")
    render = user.engine.renders.renders[0]
    name = render.order.output.name
    assert name == "clip-ahead-0001.mp4"
    user.app.window.closing = True
    assert not user.app.closed
    user.app.step()
    user.wait()
    assert user.reads(f"Not rendered to the end: {name}.")
    user.press("Stay")
    assert not user.app.closed
    press_button(user, f"cancel {render.number}")
    user.until(lambda: not user.engine.renders.open)
    user.wait()
    assert user.reads("cancelled")
    user.app.window.closing = True
    assert user.app.closed, "there is nothing to lose"
    user.app.window.closing = False
