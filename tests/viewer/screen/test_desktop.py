"""The desktop viewer on a screen of its own, by a mouse and keys that X does not tell from real."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import imageio.v3
import numpy as np
import pytest
from numpy.typing import NDArray

from iprt import cli
from iprt.device.compute import ComputeDevice, Kernel
from iprt.errors import DeviceLostError
from iprt.scene.placement import set_on
from iprt.scene.scene import Scene
from iprt.viewer.engine import Engine
from iprt.viewer.session import Shown
from tests.clips import write_clip
from tests.scene.files import CUBE
from tests.viewer.turns import DEADLINE_S, SETTINGS

pytest.importorskip("imgui_bundle", reason="needs the extra `view`")
pytest.importorskip("moderngl_window", reason="needs the extra `view`")
pytest.importorskip("Xlib", reason="needs the extra `screen`")
if shutil.which("Xvfb") is None:
    pytest.skip("needs Xvfb", allow_module_level=True)

from imgui_bundle import imgui

from iprt.viewer.desktop import app as app_module
from iprt.viewer.desktop import window as window_module
from iprt.viewer.desktop.app import App
from iprt.viewer.desktop.gizmo import GIZMO
from iprt.viewer.desktop.style import BAD
from tests.viewer.screen.x11 import Screen, xvfb

pytestmark = pytest.mark.screen

SIZE = (256, 192)
"""Of the picture."""
FRAMES = 3
"""To which it is refined."""


class User:
    """Sits before the viewer: acts by X's events, and looks at X's pixels."""

    def __init__(self, app: App, screen: Screen, folder: Path) -> None:
        self.app, self.screen, self.folder = app, screen, folder
        self.engine, self.desk = app._engine, app.desk
        self.places: dict[str, tuple[float, float, float, float]] = {}  # of widgets, by label

    def until(self, done: Callable[[], bool]) -> None:
        end = time.monotonic() + DEADLINE_S
        while not done():
            assert time.monotonic() < end, self.engine.status
            self.app.step()

    def wait(self, draws: int = 4) -> None:
        """Some drawn frames after input; none are drawn if there was none."""
        before = imgui.get_frame_count()
        for _ in range(draws):
            self.app.step()
        while imgui.get_frame_count() < before + draws and self.app.window.wait(0.0):
            self.app.step()

    def at_rest(self) -> Shown:
        """The picture of what was asked for last, refined and drawn."""

        def done() -> bool:
            sight, viewport = self.desk.sight, self.desk.viewport
            return (
                sight is not None
                and sight.shown.refined
                and sight.shown.request == viewport._wanted
                and sight.shown.number >= self.engine._exchange._world_number
            )

        self.until(done)
        self.wait(2)
        assert self.desk.sight is not None
        return self.desk.sight.shown

    def point(self, x: float, y: float) -> tuple[float, float]:
        """On the screen, of a pixel of the picture."""
        left, top = self.app.window._window.position
        return left + self.app.pane.rectangle[0] + x, top + self.app.pane.rectangle[1] + y

    def picture(self) -> NDArray[np.uint8]:
        """What the screen shows of the pane."""
        left, top = (round(value) for value in self.point(0.0, 0.0))
        width, height = (round(value) for value in self.app.pane.rectangle[2:])
        return self.screen.picture(left, top, width, height)

    def move(self, x: float, y: float) -> None:
        self.screen.move(*self.point(x, y))
        self.wait()

    def away(self) -> None:
        """The mouse off the picture, where nothing is beside it."""
        self.move(self.app.pane.rectangle[2] + 60.0, self.app.pane.rectangle[3] + 20.0)

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 4) -> None:
        self.move(*start)
        self.screen.button(1, down=True)
        self.wait(2)
        for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
            self.screen.move(*self.point(*(np.array(start) * (1 - share) + np.array(end) * share)))
            self.wait(2)
        self.screen.button(1, down=False)
        self.wait()

    def click(self, x: float, y: float) -> None:
        self.drag((x, y), (x, y), steps=1)

    def press(self, label: str, share: float = 0.5) -> None:
        """Click on a widget, at a share of its width; scroll to it first."""
        self.wait(2)
        corner, height = self.app.pane.rectangle[:2], self.app.window.size[1]
        while self.places[label][3] > height - 20.0:
            self.move(self.app.pane.rectangle[2] + 100.0, 100.0)
            self.screen.wheel(-1)
            self.wait(2)
        left, top, right, bottom = self.places[label]
        self.click(left + share * (right - left) - corner[0], 0.5 * (top + bottom) - corner[1])

    def key(self, name: str, *, control: bool = False) -> None:
        self.screen.key(name, control=control)
        self.wait()

    def problems(self) -> tuple[str, ...]:
        return self.engine.status.problems

    def reds(self) -> int:
        """Pixels of the pane in the colour of problems."""
        difference = np.abs(self.picture().astype(int) - 255.0 * np.array(BAD[:3])).max(axis=2)
        return int((difference < 12).sum())


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    with xvfb(1280, 800) as name:
        yield name


@pytest.fixture(scope="module")
def opened(
    display: str, device: ComputeDevice, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[User]:
    """One viewer of a clip of four frames; its picture has `SIZE`."""
    folder = tmp_path_factory.mktemp("desktop")
    scene = Scene.open(write_clip(folder / "clip", 4, size=SIZE))
    patch = pytest.MonkeyPatch()
    patch.setenv("DISPLAY", display)
    patch.delenv("WAYLAND_DISPLAY", raising=False)
    patch.setattr(app_module, "IDLE_S", 0.005)
    engine = Engine(scene, lambda: device, SETTINGS)
    view = scene.views["ahead"].view
    app = App(engine, view.resized(800, 600), objects=None, folder=folder, frames=FRAMES)
    screen = Screen(display)
    user = User(app, screen, folder)
    _note_places(patch, user.places)
    user.wait()
    width, height = (800 - app.pane.rectangle[2], 600 - app.pane.rectangle[3])
    app.window.size = round(SIZE[0] + width), round(SIZE[1] + height)
    user.until(lambda: app.pane.rectangle[2:] == SIZE)
    screen.focus()
    try:
        yield user
    finally:
        app.close()
        engine.close()
        screen.close()
        patch.undo()


@pytest.fixture
def user(opened: User) -> Iterator[User]:
    """The viewer as it was opened."""
    app, desk, engine = opened.app, opened.desk, opened.engine
    opened.away()
    yield opened
    desk.selected, desk.help, desk.readout = None, False, True
    desk.mode, desk.align, desk._notice = "move", False, None
    while engine.world.edits:
        engine.undo()
    engine.pause()
    engine.seek(0)
    engine.set_settings(SETTINGS)
    desk.viewport.lens = type(desk.viewport.lens)()
    desk.viewport.go_to("ahead")
    assert app.pane.gesture is None


def _note_places(patch: pytest.MonkeyPatch, places: dict[str, Any]) -> None:
    """Remember where widgets were drawn last, by their labels."""
    for name in ("slider_float", "slider_int", "button", "begin_tab_item", "collapsing_header"):
        draw = getattr(imgui, name)

        def noting(label: str, *values: Any, draw: Any = draw) -> Any:
            result = draw(label, *values)
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            places[label] = low.x, low.y, high.x, high.y
            return result

        patch.setattr(imgui, name, noting)


def rendered(user: User, path: Path, *flags: object, frame: int = 0) -> NDArray[np.uint8]:
    """What `iprt render` writes of the viewer's scene."""
    knobs = ["trace.object_rays=1", "trace.bounces=2", "trace.ratio_rows=16", "gloss.rays=2"]
    knobs += ["irradiance.rows=16", "irradiance.first_rays=2", "irradiance.rays=1"]
    words: list[object] = ["render", user.folder / "clip", "-o", path, "--frames", frame]
    words += ["--size", *SIZE, "--accumulate", FRAMES, "--device", "pocl", *flags]
    for knob in [*knobs, "atrous.levels=2"]:
        words += ["--set", knob]
    assert cli.main([str(word) for word in words]) == 0
    pixels: NDArray[np.uint8] = imageio.v3.imread(path)
    return pixels


def test_the_screen_shows_what_iprt_renders(user: User, tmp_path: Path) -> None:
    """To the bit: of a view of the scene, and of another frame after a drag and the wheel."""
    user.at_rest()
    np.testing.assert_array_equal(user.picture(), rendered(user, tmp_path / "a.png"))
    before = user.desk.viewport.view
    user.drag((128, 96), (158, 86))
    view = user.desk.viewport.view
    degrees = np.rad2deg(1.0 / before.focal_px)
    assert view.yaw_deg == pytest.approx(before.yaw_deg - 30 * degrees)
    assert view.pitch_deg == pytest.approx(before.pitch_deg - 10 * degrees)
    user.move(128, 96)
    user.screen.wheel(3)
    user.wait()
    assert user.desk.viewport.view.fov_y_deg < 0.8 * before.fov_y_deg
    user.key("Right")
    user.away()
    # Frames in motion leave their noise: another seed begins anew.
    user.engine.set_settings(SETTINGS.model_copy(update={"seed": 7}))
    shown = user.at_rest()
    assert shown.frame == 1
    view = shown.request.view
    flags = ("--seed", 7, "--yaw", view.yaw_deg, "--pitch", view.pitch_deg, "--fov", view.fov_y_deg)
    expected = rendered(user, tmp_path / "b.png", *flags, frame=1)
    np.testing.assert_array_equal(user.picture(), expected)


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
    for name, act in events.items():
        drawn = quiet_frames(user)
        act()
        for _ in range(20):
            user.app.step()
        assert imgui.get_frame_count() > drawn, name


def quiet_frames(user: User) -> int:
    """Steps until no frames are drawn any more; how many were, in all."""
    while True:
        drawn = imgui.get_frame_count()
        for _ in range(20):
            user.app.step()
        if imgui.get_frame_count() == drawn:
            return drawn


def test_keys(user: User) -> None:
    user.at_rest()
    user.key("space")
    assert user.desk.playing
    user.key("space")
    assert not user.desk.playing
    user.key("h")
    assert user.desk.help
    user.key("Escape")
    assert not user.desk.help
    user.at_rest()
    seen = user.picture()
    user.key("F12")
    (written,) = user.folder.glob("*.png")
    np.testing.assert_array_equal(imageio.v3.imread(written), seen)
    written.unlink()
    user.click(*cube_pixel(user))
    assert user.desk.selected == "cube"
    user.key("Delete")
    user.at_rest()
    assert not user.engine.objects
    user.key("z", control=True)
    user.at_rest()
    assert [state.name for state in user.engine.objects] == ["cube"]


def test_closing_asks_about_edits(user: User) -> None:
    user.at_rest()
    path = user.folder / "clip" / "scene.toml"
    text = path.read_text()
    user.app.window.closing = True
    assert user.app.closed, "there is nothing to save"
    user.engine.remove("cube")
    assert not user.app.closed
    assert user.desk.leaving
    user.press("Stay")
    assert not user.app.closed
    assert not user.desk.leaving
    user.app.window.closing = True
    assert not user.app.closed
    user.press("Save and close")
    user.until(lambda: user.app.closed)
    assert "cube" not in path.read_text()
    user.app.window.closing = False
    path.write_text(text)
    user.until(lambda: shows(user, "cube"))


def shows(user: User, name: str) -> bool:
    sight = user.desk.sight
    geometry = None if sight is None else sight.shown.geometry
    return geometry is not None and name in geometry.names


def cube_pixel(user: User) -> tuple[float, float]:
    """In its middle."""
    view = user.at_rest().request.view
    x, y = view.project(user.engine.objects[0].to_world[:3, 3])
    return float(x), float(y)


def test_an_object_slides_over_surfaces(user: User) -> None:
    """Its foot follows the mouse, as far as the mouse was moved, on the real depth there."""
    x, y = cube_pixel(user)
    user.click(x, y)
    assert user.desk.selected == "cube"
    state = user.engine.objects[0]
    shown = user.at_rest()
    geometry = shown.geometry
    assert geometry is not None
    low, high = state.corners
    foot = np.array([0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])])
    pixel = shown.request.view.project(state.to_world[:3, :3] @ foot + state.to_world[:3, 3])
    # On the object, but not where the gizmo is.
    grip = next((x + dx, y - 8.0) for dx in range(0, 20) if not over_gizmo(user, x + dx, y - 8.0))
    user.drag(grip, (grip[0] + 30.0, grip[1] + 12.0))
    surface = geometry.real(int(pixel[0] + 30.0), int(pixel[1] + 12.0))
    assert surface is not None
    edit = user.engine.world.edit_of("cube").to_world
    assert edit is not None
    expected = set_on(state.to_world, state.corners, surface.point)
    np.testing.assert_allclose(np.reshape(edit, (4, 4)), expected, atol=0.03)
    assert user.at_rest().request.view == shown.request.view, "the view has not turned"
    user.key("z", control=True)
    assert user.engine.world.edits == ()


def over_gizmo(user: User, x: float, y: float) -> bool:
    user.move(x, y)
    return bool(GIZMO.is_over())


def test_the_gizmo_moves_along_an_axis(user: User) -> None:
    user.click(*cube_pixel(user))
    state = user.engine.objects[0]
    view = user.at_rest().request.view
    low, _ = state.corners
    foot = state.to_world[:3, :3] @ np.array([0.0, low[1], 0.0]) + state.to_world[:3, 3]
    start, ahead = view.project(foot + np.array([(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)]))
    along = (ahead - start) / np.linalg.norm(ahead - start)
    grips = (start + distance * along for distance in range(4, 40, 2))

    def on_axis(grip: NDArray[np.float64]) -> bool:
        over = over_gizmo(user, *grip)
        return over and GIZMO.get_hovered_handle_type() == GIZMO.MOVETYPE.mt_move_x

    grip = next(grip for grip in grips if on_axis(grip))
    user.drag((grip[0], grip[1]), (grip[0] + 20 * along[0], grip[1] + 20 * along[1]))
    edit = user.engine.world.edit_of("cube").to_world
    assert edit is not None
    moved = np.reshape(edit, (4, 4)) - state.to_world
    np.testing.assert_allclose(moved[:3, :3], 0.0, atol=1e-5)
    np.testing.assert_allclose(moved[1:3, 3], 0.0, atol=1e-4)
    there = view.project(foot + moved[:3, 3])
    np.testing.assert_allclose(there - start, 20 * along, atol=2.0)


def test_sliders(user: User, tmp_path: Path) -> None:
    """One of the settings is rendered with, one of the lens only developed with."""
    before = user.at_rest().picture.color
    user.press("Settings")
    user.press("trace")
    user.press("##trace.thickness", 0.7)
    user.away()
    after = user.at_rest().picture.color
    thickness = user.engine.world.settings.trace.thickness
    assert thickness > 2.0 * SETTINGS.trace.thickness
    assert not np.array_equal(after, before)
    expected = rendered(user, tmp_path / "a.png", "--set", f"trace.thickness={thickness}")
    np.testing.assert_array_equal(user.picture(), expected)
    user.press("trace")
    user.press("Picture")
    user.press("##exposure", 0.75)
    lens = user.desk.viewport.lens
    assert lens.exposure_ev == pytest.approx(4.0, abs=0.5)
    user.away()
    shown = user.at_rest()
    assert np.array_equal(shown.picture.color, after)
    expected = lens.develop(after, user.engine.scene.exposure)
    np.testing.assert_array_equal(user.picture(), expected)


def test_a_window_of_one_pixel(user: User) -> None:
    user.at_rest()
    size = user.app.window.size
    user.app.window.size = (1, 1)
    user.until(lambda: user.app.window.size == (1, 1))
    user.wait(3)
    user.app.window.size = size
    user.until(lambda: user.app.pane.rectangle[2:] == SIZE)
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
    path.write_text(text.replace('name = "ahead"', 'name = "another"'))
    user.until(lambda: "another" in user.engine.scene.views)
    user.wait()
    path.write_text(text)
    user.until(lambda: "ahead" in user.engine.scene.views)
    assert user.problems() == ()
    user.at_rest()
    np.testing.assert_array_equal(user.picture(), seen)


def test_files_that_are_dropped(user: User) -> None:
    """A mesh is added at the cursor; one that cannot be read is told of, and all goes on."""
    user.at_rest()
    good, bad = user.folder / "box of mine.obj", user.folder / "broken.obj"
    good.write_text(CUBE)
    bad.write_text("v 1 2\nf 1 2 3\n")
    x, y = (round(value) for value in user.point(60.0, 150.0))
    user.screen.drop(str(bad), x, y, user.app.step)
    user.until(lambda: any("broken.obj" in problem for problem in user.problems()))
    user.screen.drop(str(good).replace(" ", "%20"), x, y, user.app.step)
    user.until(lambda: len(user.engine.objects) == 2)
    state = user.engine.objects[1]
    view = user.at_rest().request.view
    low, high = state.corners
    foot = state.to_world[:3, :3] @ (0.5 * (low + high) * (1, 0, 1) + low * (0, 1, 0))
    pixel = view.project(foot + state.to_world[:3, 3])
    assert abs(pixel - (60.0, 150.0)).max() < 12.0
    assert user.desk.selected == state.name


def test_a_device_that_is_lost(user: User, monkeypatch: pytest.MonkeyPatch) -> None:
    """Twice: that is told, and the next input is answered."""
    user.at_rest()
    seen, left = user.picture(), [2]
    launch = Kernel.__call__

    def failing(kernel: Kernel, *args: Any) -> None:
        if left[0] and kernel._name == "composite":
            left[0] -= 1
            raise DeviceLostError("the device gave up")
        launch(kernel, *args)

    monkeypatch.setattr(Kernel, "__call__", failing)
    user.drag((128, 96), (150, 96))
    user.until(lambda: any("gave up" in problem for problem in user.problems()))
    user.wait()
    assert user.reds() > 50
    user.drag((150, 96), (128, 96))
    user.away()
    user.at_rest()
    assert user.problems() == ()
    assert np.abs(user.picture().astype(int) - seen).mean() < 2.0


def test_what_is_missing_is_told() -> None:
    """Without a display, without the extra: in a process in which no window was ever open."""
    script = (
        "import sys, types, pathlib\n"
        "from iprt.scene.camera import View\n"
        "from iprt.viewer import desktop\n"
        "if 'extra' in sys.argv: sys.modules['imgui_bundle'] = None\n"
        "engine = types.SimpleNamespace(scene=types.SimpleNamespace(name='room'))\n"
        "try: desktop.run(engine, View(64, 64))\n"
        "except desktop.IprtError as error: print(error)\n"
    )
    environment = {k: v for k, v in os.environ.items() if "DISPLAY" not in k}
    for missing, expected in (("display", "--web"), ("extra", "pip install 'iprt[view]'")):
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
