"""The desktop viewer on a screen of its own, by a mouse and keys that X does not tell from real."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from itertools import product
from pathlib import Path

import imageio.v3
import numpy as np
import pytest
from imgui_bundle import imgui
from numpy.typing import NDArray

from iprt import cli
from iprt.scene.placement import set_on
from iprt.viewer.desktop.gizmo import GIZMO
from tests.films import FEW
from tests.viewer.screen.user import FRAMES, SIZE, User
from tests.viewer.turns import SETTINGS


def rendered(user: User, path: Path, *flags: object, frame: int = 0) -> NDArray[np.uint8]:
    """What `iprt render` writes of the viewer's scene."""
    settings = [
        f"{group}.{name}={json.dumps(value)}"
        for group, few in FEW.items()
        for name, value in few.items()
    ]
    words: list[object] = ["render", user.folder / "clip", "-o", path, "--frames", frame]
    words += ["--size", *SIZE, "--accumulate", FRAMES, "--device", "pocl", *flags]
    for setting in settings:
        words += ["--set", setting]
    assert cli.main([str(word) for word in words]) == 0
    pixels: NDArray[np.uint8] = imageio.v3.imread(path)
    return pixels


def test_the_screen_shows_what_iprt_renders(user: User, tmp_path: Path) -> None:
    """To the bit: of a view of the scene, and of another frame after a drag and the wheel."""
    # What other tests moved leaves its noise: another seed begins anew.
    user.engine.set_settings(SETTINGS.model_copy(update={"seed": 5}))
    user.at_rest()
    expected = rendered(user, tmp_path / "a.png", "--seed", 5)
    np.testing.assert_array_equal(user.picture(), expected)
    before = user.ui.viewport.view
    user.drag((128, 96), (158, 86))
    view = user.ui.viewport.view
    degrees = np.rad2deg(1.0 / before.focal_px)
    assert view.yaw_deg == pytest.approx(before.yaw_deg - 30 * degrees)
    assert view.pitch_deg == pytest.approx(before.pitch_deg - 10 * degrees)
    user.move(128, 96)
    user.screen.wheel(3)
    user.wait()
    assert user.ui.viewport.view.fov_y_deg < 0.8 * before.fov_y_deg
    user.key("Right")
    user.away()
    user.at_rest()
    user.engine.set_settings(SETTINGS.model_copy(update={"seed": 7}))
    shown = user.at_rest()
    assert shown.frame == 1
    view = shown.request.view
    flags = ("--seed", 7, "--yaw", view.yaw_deg, "--pitch", view.pitch_deg, "--fov", view.fov_y_deg)
    expected = rendered(user, tmp_path / "b.png", *flags, frame=1)
    np.testing.assert_array_equal(user.picture(), expected)


def test_keys(user: User) -> None:
    user.at_rest()
    user.at_rest()
    seen = user.picture()
    user.key("F12")
    (written,) = (user.folder / "Pictures" / "iprt").glob("*.png")
    np.testing.assert_array_equal(imageio.v3.imread(written), seen)
    written.unlink()
    user.click(*user.cube())
    assert user.ui.selected == "cube"
    user.key("Delete")
    user.at_rest()
    assert not user.engine.objects
    user.key("z", control=True)
    user.at_rest()
    assert [state.name for state in user.engine.objects] == ["cube"]


def test_an_object_slides_over_surfaces(user: User) -> None:
    """Its foot follows the mouse, as far as the mouse was moved, on the real depth there."""
    x, y = user.cube()
    user.click(x, y)
    assert user.ui.selected == "cube"
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
    user.click(*user.cube())
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
    lens = user.ui.viewport.lens
    assert lens.exposure_ev == pytest.approx(4.0, abs=1.0)
    user.away()
    shown = user.at_rest()
    assert np.array_equal(shown.picture.color, after)
    expected = lens.develop(after, user.engine.scene.exposure)
    np.testing.assert_array_equal(user.picture(), expected)


def test_the_bar_between_picture_and_input(user: User) -> None:
    user.at_rest()
    user.ui.viewport.lens = replace(user.ui.viewport.lens, against="input")
    user.away()
    user.at_rest()
    user.drag((128, 60), (70, 40))
    lens = user.ui.viewport.lens
    assert lens.split == pytest.approx(70 / SIZE[0], abs=0.01)
    user.away()
    picture = user.at_rest().picture
    exposure = user.engine.scene.exposure
    ours, real = (lens.develop(p, exposure) for p in (picture.color, picture.aovs["background"]))
    assert (ours != real).any()
    seen = user.picture()[50:]  # below the caption
    np.testing.assert_array_equal(seen[:, :60], ours[50:, :60])
    np.testing.assert_array_equal(seen[:, 80:], real[50:, 80:])
    assert not np.array_equal(seen[:, 60:80], ours[50:, 60:80]), "the bar"


OVERLAPS = {
    "one after the other": "CKkc",
    "the modifier first": "CKck",
}
"""In which order control (C) and the key (K) go down, and (c, k) up."""


def type_chord(user: User, name: str, order: str, drawn_after: int) -> None:
    """Press keys in an order; frames are drawn after so many of the four events, and at the end."""
    for number, event in enumerate(order, start=1):
        user.screen.hold({"c": "Control_L", "k": name}[event.lower()], down=event.isupper())
        if number == drawn_after:
            user.wait()
    user.wait(6)


@pytest.mark.parametrize(
    ("order", "drawn_after"),
    [pytest.param(o, n, id=f"{k}-{n}") for (k, o), n in product(OVERLAPS.items(), range(5))],
)
def test_quick_chords(user: User, order: str, drawn_after: int) -> None:
    """Ctrl+S saves, Ctrl+Z and Ctrl+Y undo and redo, whichever of their events share a frame."""
    user.at_rest()
    path = user.folder / "clip" / "scene.toml"
    text = path.read_text()
    user.engine.editor.remove(["cube"])
    for name, edits in (("z", 0), ("y", 1)):
        type_chord(user, name, order, drawn_after)
        assert len(user.engine.world.edits) == edits, name
    type_chord(user, "s", order, drawn_after)
    assert user.ui.mode == "move", "Ctrl+S is not S"
    user.until(lambda: "cube" not in path.read_text())
    assert not user.ui.browsing
    path.write_text(text)
    user.until(lambda: user.shows("cube"))


def test_keys_that_are_held_down(user: User) -> None:
    """Frames go on and on; what is switched is switched once."""
    user.at_rest()
    user.screen.hold("v", down=True)
    user.until(lambda: not user.ui.readout)
    user.screen.hold("Right", down=True)
    user.until(lambda: user.ui.frame == 3)
    user.screen.hold("Right", down=False)
    user.screen.hold("Left", down=True)
    user.screen.hold("v", down=False)
    user.until(lambda: user.ui.frame == 0)
    user.screen.hold("Left", down=False)
    user.screen.hold("v", down=True)
    switched = imgui.get_io().key_repeat_delay + 4.0 * imgui.get_io().key_repeat_rate
    end = time.monotonic() + 2.0 * switched
    user.until(lambda: time.monotonic() > end)
    user.screen.hold("v", down=False)
    user.wait()
    assert user.ui.readout, "off and on again"


def test_escape_closes_what_is_open_first(user: User) -> None:
    """The color picker of an object, and the object is let go of only then."""
    user.press("Scene")
    user.click(*user.cube())
    assert user.ui.selected == "cube"
    user.press("##color", 0.97)
    assert imgui.is_popup_open("", ANY_POPUP)
    user.key("Escape")
    assert not imgui.is_popup_open("", ANY_POPUP)
    assert user.ui.selected == "cube"
    user.key("Escape")
    assert user.ui.selected is None


ANY_POPUP = imgui.PopupFlags_.any_popup_id | imgui.PopupFlags_.any_popup_level
