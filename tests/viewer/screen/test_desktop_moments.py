"""Bad moments of the desktop viewer, and quiet ones."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
from imgui_bundle import imgui

from iprt.viewer import core as core_module
from iprt.viewer.desktop import window as window_module
from tests.scene.files import CUBE
from tests.viewer.screen.user import SIZE, User


def test_draws_for_a_reason_only(user: User, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the user does wakes the window; at rest it costs next to nothing."""
    monkeypatch.setattr(window_module, "STIRRED_S", 0.03)
    user.at_rest()
    x, y = user.point(20.0, 20.0)
    events: dict[str, Callable[[], None]] = {
        "move": lambda: user.screen.move(x, y),
        "press": lambda: user.screen.button(3, down=True),
        "drag": lambda: user.screen.move(x + 2.0, y),
        "release": lambda: user.screen.button(3, down=False),
        "wheel": lambda: user.screen.wheel(1),
        "key": lambda: user.screen.key("Shift_L"),
    }
    for act in events.values():
        drawn = quiet_frames(user)
        act()
        user.until(lambda drawn=drawn: imgui.get_frame_count() > drawn)


def quiet_frames(user: User) -> int:
    """Steps until no frames are drawn any more; how many were, in all."""
    while True:
        drawn = imgui.get_frame_count()
        for _ in range(20):
            user.app.step()
        if imgui.get_frame_count() == drawn:
            return drawn


def test_closing_asks_about_edits(user: User) -> None:
    user.at_rest()
    user.app.window.closing = True
    assert user.app.closed, "there is nothing to save"
    user.engine.editor.remove(["cube"])
    assert not user.app.closed
    assert user.ui.leaving
    user.press("Stay")
    assert not user.app.closed
    assert not user.ui.leaving


def test_saving_and_closing_after_bad_news(user: User, monkeypatch: pytest.MonkeyPatch) -> None:
    """The question is seen at once. A failed save keeps the window open, old problems do not."""
    path = user.folder / "clip" / "scene.toml"
    text = path.read_text()
    bad = user.folder / "broken.obj"
    bad.write_text("v 1 2\nf 1 2 3\n")
    user.ui.add_all([bad])
    user.until(lambda: user.problems() != ())
    user.engine.editor.remove(["cube"])
    user.at_rest()
    quiet_frames(user)
    user.places.pop("Save and close", None)
    user.app.window.closing = True
    assert not user.app.closed
    user.app.step()
    path.write_text(text.replace("format = 1", "format = "))
    user.press("Save and close")
    user.until(lambda: not user.ui.closing)
    assert not user.app.closed
    assert user.engine.unsaved
    path.write_text(text)
    user.app.window.closing = True
    assert not user.app.closed
    user.press("Save and close")
    user.until(lambda: user.app.closed)
    user.app.step()
    assert user.ui.notice == (f"saved to {path}", False)
    assert "cube" not in path.read_text()
    user.app.window.closing = False
    path.write_text(text)
    user.until(lambda: user.shows("cube"))
    monkeypatch.setattr(core_module, "NOTE_S", 0.0)
    user.until(lambda: user.problems() == ())


def test_words_that_come_late_are_whole(user: User) -> None:
    """A box of words has its size although nothing happens after they came."""
    user.away()
    user.at_rest()
    quiet_frames(user)
    user.ui.say("short")
    user.app.step()
    quiet_frames(user)
    user.ui.say("a notice of so many words that they have no place in the box of the one before")
    user.app.step()
    quiet_frames(user)
    seen = user.picture()
    user.screen.key("Shift_L")  # drawn again
    user.wait(8)
    np.testing.assert_array_equal(user.picture(), seen)


def test_a_wrong_path_keeps_the_list_of_files_open(user: User) -> None:
    """It names the reason, and the path can be mended."""
    user.at_rest()
    objects = len(user.engine.objects)
    (user.folder / "notes.txt").touch()
    (user.folder / "found.obj").write_text(CUBE)

    def enter(name: str) -> None:
        user.ui.browsing = False
        user.wait()
        user.app._browser._text = str(user.folder / name)  # as if it was typed
        user.key("a")
        user.wait(8)
        user.key("Return")
        user.wait(8)

    for wrong, reason in (("lost.obj", "no such file"), ("notes.txt", "not a mesh")):
        enter(wrong)
        assert user.ui.browsing
        assert reason in user.app._browser._problem
        assert user.reds() > 50, "it is not told"
    enter("found.obj")
    assert not user.ui.browsing
    user.until(lambda: len(user.engine.objects) == objects + 1)
    assert user.engine.objects[-1].name == "found"


def test_escape_closes_the_list_of_files(user: User) -> None:
    """Also while a path is typed."""
    user.at_rest()
    user.key("a")
    user.wait()
    assert user.ui.browsing
    assert imgui.get_io().want_text_input
    user.key("Escape")
    assert not user.ui.browsing


def test_a_window_of_one_pixel(user: User) -> None:
    user.at_rest()
    size = user.app.window.size
    user.app.window.size = (1, 1)
    user.until(lambda: user.app.window.size == (1, 1))
    user.wait(3)
    user.app.window.size = size
    user.until(lambda: user.app.picture_view.rectangle[2:] == SIZE)
    shown = user.at_rest()
    assert (shown.request.view.width, shown.request.view.height) == SIZE
    assert shown.picture.color.std() > 0.0
    assert user.problems() == ()


def test_a_scene_file_that_breaks_and_is_mended(user: User) -> None:
    user.press("Scene")
    user.away()
    user.at_rest()
    path = user.folder / "clip" / "scene.toml"
    text = path.read_text()
    seen, reds = user.picture(), user.reds()
    path.write_text(text.replace("format = 1", "format = "))
    user.until(lambda: user.problems() != ())
    user.wait()
    assert user.reds() > reds + 50, "the problem is told"
    top = user.picture()[:80]
    np.testing.assert_array_equal(top, seen[:80], "the picture stays")
    path.write_text(text)
    user.until(lambda: user.problems() == ())
    user.at_rest()
    np.testing.assert_array_equal(user.picture(), seen)


def test_files_that_are_dropped(user: User) -> None:
    """A mesh is added at the cursor; one that cannot be read is told of, and all goes on.

    What becomes of a file is told in a line, which has no room for its folder.
    """
    user.at_rest()
    good, bad = user.folder / "box of mine.obj", user.folder / "broken.obj"
    other = user.folder / "notes.txt"
    good.write_text(CUBE)
    bad.write_text("v 1 2\nf 1 2 3\n")
    other.touch()
    user.drop(other, 60.0, 150.0)
    user.until(lambda: user.reads("notes.txt: not a mesh"))
    assert not user.reads(f"{other}: not")
    user.drop(bad, 60.0, 150.0)
    user.until(lambda: any("broken.obj" in problem for problem in user.problems()))
    user.drop(good, 60.0, 150.0)
    user.until(lambda: user.reads("reading box of mine.obj"))
    assert not user.reads(f"reading {good}")
    user.until(lambda: len(user.engine.objects) == 2)
    state = user.engine.objects[1]
    view = user.at_rest().request.view
    assert user.problems() == (), "what came of the file before holds no more"
    foot = state.to_world[:3, :3] @ state.foot + state.to_world[:3, 3]
    pixel = view.project(foot)
    assert abs(pixel - (60.0, 150.0)).max() < 12.0
    assert user.ui.selected == state.name


def test_what_is_missing_is_said() -> None:
    """Without a display, without the extra: in a process in which no window was ever open."""
    script = (
        "import sys, types, pathlib\n"
        "from iprt.geometry.camera import View\n"
        "from iprt.errors import IprtError\n"
        "from iprt.viewer import desktop\n"
        "from iprt.viewer.windows import Start\n"
        "if 'extra' in sys.argv: sys.modules['imgui_bundle'] = None\n"
        "engine = types.SimpleNamespace(scene=types.SimpleNamespace(name='room'))\n"
        "try: desktop.run(engine, Start(View(64, 64)), None)\n"
        "except IprtError as error: print(error)\n"
    )
    environment = {k: v for k, v in os.environ.items() if "DISPLAY" not in k}
    for missing, expected in (("display", "--web"), ("extra", "install the extra `view`")):
        done = subprocess.run(
            [sys.executable, "-c", script, missing],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        assert expected in done.stdout, done.stdout
        assert done.stdout.count("\n") == 1
        assert done.stderr == ""
