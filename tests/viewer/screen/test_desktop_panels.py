"""The desktop viewer's panels, bars and dialogs, as they are read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui

from iprt.viewer.desktop.style import ACCENT
from iprt.viewer.displayed_frame import DisplayedFrame
from iprt.viewer.gizmo import box_edges
from iprt.viewer.motion_quality import Preview
from tests.viewer.screen.looking import texts, widget
from tests.viewer.screen.user import SIZE, User


def drag_slider(user: User, label: str, *, look: Callable[[], None]) -> None:
    """From one end to the other; `look` is called on the way."""
    left, top, right, bottom = user.places[label]
    x, y = user.app.window.position
    user.screen.move(x + left + 8, y + 0.5 * (top + bottom))
    user.wait()
    user.screen.button(1, down=True)
    for share in np.linspace(0.0, 1.0, 9):
        user.screen.move(x + left + 8 + share * (right - left - 16), y + 0.5 * (top + bottom))
        user.wait()
        look()
    user.screen.button(1, down=False)
    user.wait()


def test_rows_stay_where_they_are_during_a_drag(user: User) -> None:
    """Also where what is dragged is no default any more, and the settings no preset."""
    user.press("Settings")
    user.press("trace")
    user.scroll_to("##trace.thickness")
    user.away()
    labels = [label for label in user.places if label.startswith("##trace.")]
    assert len(labels) > 4
    before = {label: user.places[label] for label in labels}
    after = []

    def look() -> None:
        after.append({label: user.places[label] for label in labels})

    start = user.ui.settings.trace.thickness
    drag_slider(user, "##trace.thickness", look=look)
    assert user.ui.settings.trace.thickness != start
    assert after == [before] * len(after)
    user.press("trace")
    user.press("Scene")


def test_a_dialog_has_its_size_from_the_beginning(user: User) -> None:
    user.engine.editor.remove(["cube"])
    user.at_rest()
    sizes = []
    draw = imgui.end

    def noting() -> None:
        name = imgui.internal.get_current_window().name
        if name == "Unsaved edits" and not imgui.internal.get_current_window().hidden:
            sizes.append(tuple(imgui.get_window_size()))
        draw()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(imgui, "end", noting)
        user.ui.leaving = True
        for shift in range(6):
            user.move(20.0 + shift, 20.0)
    user.ui.leaving = False
    assert len(sizes) >= 3
    assert len(set(sizes)) == 1, sizes


def test_undo_and_redo_are_grey_when_there_is_nothing_to_do(user: User) -> None:
    """Saving leaves what can be undone."""
    user.press("Scene")
    user.at_rest()
    path = user.folder / "clip" / "scene.toml"
    text = path.read_text()
    undo, redo, save = (
        next(label for label in user.places if label.endswith(f"##{name}"))
        for name in ("undo", "redo", "save")
    )

    def lit() -> tuple[bool, bool, bool]:
        user.away()
        return tuple(texts(widget(user, label)) > 8 for label in (undo, redo, save))

    while user.engine.can_undo:
        user.engine.undo()
    assert lit()[::2] == (False, False)
    user.engine.editor.remove(["cube"])
    assert lit() == (True, False, True)
    user.press(undo)
    assert lit() == (False, True, False)
    user.press(redo)
    user.press(save)
    user.until(lambda: not user.engine.unsaved)
    assert lit() == (True, False, False)
    path.write_text(text)
    user.until(lambda: user.shows("cube"))


def test_values_at_the_mouse_hide_nothing_of_interest(wide: User) -> None:
    """Neither the object that is edited nor the place at the mouse, wherever these are."""
    wide.press("Scene")
    wide.click(*wide.cube())
    assert_values_beside(wide)
    wide.drag((20.0, 150.0), (240.0, 62.0))  # the object goes to where values usually are
    assert_values_beside(wide)


def assert_values_beside(wide: User) -> None:
    state = wide.ui.state
    assert state is not None
    view = wide.at_rest().request.view
    ends = box_edges(state, view, np.zeros(3)).reshape(-1, 2)
    low, high = ends.min(axis=0), ends.max(axis=0)
    right, bottom = wide.app.picture_view.rectangle[2:]
    for x, y in (wide.cube(), (right - 12.0, bottom - 12.0), (300.0, 100.0)):
        wide.move(x, y)
        wide.wait(6)
        seen = wide.picture().astype(int)
        wide.key("v")
        wide.wait(6)
        changed = np.abs(wide.picture() - seen).max(axis=2) > 8
        wide.key("v")
        rows, columns = np.nonzero(changed)
        assert rows.size > 500
        first, last = np.array([columns.min(), rows.min()]), np.array([columns.max(), rows.max()])
        assert not ((first <= (x, y)) & ((x, y) <= last)).all(), "the mouse"
        assert ((last < low) | (first > high)).any(), "the object"


def showing(user: User, patch: pytest.MonkeyPatch, **parts: object) -> None:
    """Let the window show a picture that is as the one at rest but for these parts."""
    user.at_rest()
    user.away()
    displayed = user.ui.displayed
    assert isinstance(displayed, DisplayedFrame)
    other = replace(displayed, **parts)  # type: ignore[arg-type]
    patch.setattr(user.ui.viewport, "poll", lambda: other)
    user.wait(6)


def test_what_misleads_in_a_comparison_is_said(user: User, monkeypatch: pytest.MonkeyPatch) -> None:
    showing(user, monkeypatch)
    before = texts(user.picture(), ACCENT)
    showing(user, monkeypatch, caption="Picture | Truth", warning="the truth is of another day")
    upper = user.picture()[: SIZE[1] // 2, SIZE[0] // 3 :]
    assert texts(upper, ACCENT) > before + 40
    assert texts(upper) > 40


def test_a_preview_is_named_and_explained(user: User, monkeypatch: pytest.MonkeyPatch) -> None:
    """Briefly; all that is given up, where the mouse is on it."""
    preview = Preview("Preview at 25% resolution", "fewer of these, and " * 12)
    showing(user, monkeypatch, preview=preview)
    seen = user.picture()
    lower = seen[-30:, :200]
    assert texts(lower) > 40
    assert texts(seen[:-30]) == 0
    assert not user.reads(preview.details)
    user.move(60.0, SIZE[1] - 20.0)
    user.until(lambda: user.reads(preview.details))


def test_how_the_video_plays(wide: User) -> None:
    """The buttons do what they say, and the frame is counted."""
    loop = next(label for label in wide.places if label.endswith("##loop"))
    for on in (True, False):
        wide.press(loop)
        assert wide.engine.playback.loop == on
    wide.press("##mode")
    wide.press("Every frame")
    assert wide.engine.playback.mode == "every frame"
    wide.at_rest()
    wide.screen.key("space")
    wide.until(lambda: wide.ui.playing)
    wide.until(lambda: wide.reads("3 of 3"))
    wide.until(lambda: not wide.ui.playing)
    wide.key("Left")
    wide.until(lambda: wide.reads("2 of 3"))


def test_news_of_an_added_mesh_are_told(user: User) -> None:
    user.at_rest()
    user.away()
    before = texts(user.picture())
    shared = user.engine._shared

    def written() -> bool:
        # Again, as the engine may just have reported something else.
        news = ("box.glb: its vertex colors are not shown",)
        shared.report(replace(shared.status, notes=news))
        user.wait(6)
        return texts(user.picture()) > before + 100

    user.until(written)
    shared.report(replace(shared.status, notes=()))


def test_the_profile_names_the_passes(user: User) -> None:
    user.at_rest()
    user.press("Profile")
    user.until(lambda: "composite" in user.places)
    user.press("Scene")
