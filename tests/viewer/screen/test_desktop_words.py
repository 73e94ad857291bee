"""What the desktop viewer says in words: tooltips, figures, and what cannot be chosen."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial

import imageio.v3
import numpy as np
import pytest

from iprt.settings.methods import DEFAULT
from iprt.viewer import labels
from iprt.viewer.labels import Label
from iprt.viewer.lens import BUFFERS
from tests.scene.files import write_rgb
from tests.viewer.screen.looking import texts, widget
from tests.viewer.screen.user import SIZE, User

SPEED = re.compile(r"latency .*|[\d.]+ fps")


@contextmanager
def tab(user: User, name: str) -> Iterator[None]:
    """With one of the panels; afterwards that of the scene."""
    user.press(name)
    yield
    user.press("Scene")


CHOOSABLE = {
    key: label
    for key, label in labels.comparisons().items()
    if key not in ("truth", "snapshot", DEFAULT)
}
"""A view without truth and snapshot, rendered by the default method, is compared with these."""


def test_a_truth_that_is_not_there_cannot_be_chosen(user: User) -> None:
    """It is grey and says why, until the view has a truth."""
    folder = user.folder / "clip"
    path = folder / "scene.toml"
    text = path.read_text()
    user.at_rest()
    with tab(user, "Picture"):
        user.press("##against")
        assert texts(widget(user, "Input")) > 20
        assert texts(widget(user, "Truth")) == 0
        user.press("Truth")
        user.until(lambda: user.reads("view 'ahead' has no truth"))
        assert user.ui.viewport.lens.against is None
        user.key("Escape")
        write_rgb(folder / "truth.exr", np.ones((SIZE[1], SIZE[0], 3), np.float32))
        path.write_text(text + 'objects = ["cube"]\ntruth = "truth.exr"\n')
        user.until(lambda: user.ui.viewport.truth_problem is None)
        user.at_rest()
        user.press("##against")
        user.away()
        assert texts(widget(user, "Truth")) > 20
        user.press("Truth")
        user.until(lambda: user.reads("Picture | Truth"))
    path.write_text(text)
    user.until(lambda: user.ui.viewport.truth_problem is not None)


def test_colors_are_srgb_and_say_so(user: User) -> None:
    """What is seen and typed is sRGB; what the scene gets is linear."""
    user.press("Scene")
    user.click(*user.cube())
    user.scroll_to("##color")
    assert user.reads("Color (sRGB)")
    linear = np.array(user.engine.objects[0].materials[0].albedo)
    shown = np.where(linear > 0.0031308, 1.055 * linear ** (1.0 / 2.4) - 0.055, 12.92 * linear)
    _, top, right, bottom = user.places["##color"]
    user.places["swatch"] = right - 14.0, top + 6.0, right - 6.0, bottom - 6.0
    user.away()
    assert np.abs(widget(user, "swatch") - 255.0 * shown).max() < 3.0
    for label, share in (("Color (sRGB)", 0.5), ("##color", 0.97)):
        user.hover(label, share)
        user.until(lambda: user.reads("sRGB", "stores linear values: 0.5, 0.3, 0.2."))
        user.away()
        user.until(lambda: not user.reads("stores linear values"))
    user.screen.hold("Control_L", down=True)
    user.wait()
    user.press("##color", 0.12)
    user.screen.hold("Control_L", down=False)
    user.wait()
    for key in ("0", "period", "5", "Return"):
        user.key(key)
    (material,) = user.engine.object_state("cube").materials
    assert material.albedo == pytest.approx((0.21404, 0.3, 0.2), abs=2e-4)


@pytest.mark.parametrize(
    ("panel", "list_name", "options"),
    [
        ("Scene", "##material", labels.MATERIALS),
        ("Picture", "##buffer", BUFFERS),
        ("Picture", "##against", CHOOSABLE),
    ],
    ids=["materials", "buffers", "comparisons"],
)
def test_what_can_be_chosen_is_explained(
    user: User, panel: str, list_name: str, options: Mapping[str, Label]
) -> None:
    """Each by a tooltip of its own, in the list and once it is chosen."""
    user.click(*user.cube())
    with tab(user, panel):
        user.press(list_name)
        for option in options.values():
            while not user.reads(option.name):
                user.screen.wheel(-1)
                user.wait(6)
            user.until(partial(_explained, user, option))
        user.click(*user.mouse)
        user.away()
        user.until(lambda: not user.reads(option.about))
        user.hover(list_name)
        user.until(lambda: user.reads(option.about))


def _explained(user: User, option: Label) -> bool:
    """Its tooltip is there, once the list has stopped to scroll."""
    user.hover(option.name)
    return user.reads(option.about)


def test_screenshots_are_where_the_viewer_says(user: User) -> None:
    """In the user's pictures; the panel names the folder, and the message the whole path."""
    folder = user.folder / "Pictures" / "iprt"
    user.at_rest()
    with tab(user, "Picture"):
        user.hover("##exposure")
        user.screen.wheel(-20)  # to the end
        user.until(lambda: user.reads(f"to {folder}"))
        for number, kind in ((1, "PNG"), (2, "PNG"), (1, "EXR")):
            button = next(label for label in user.places if label.endswith(f"##{kind}"))
            user.press(button)
            path = folder / f"clip-ahead-{number:04d}.{kind.lower()}"
            assert user.reads(f"written: {path}")
            assert path.is_file()
    user.away()
    seen = imageio.v3.imread(folder / "clip-ahead-0002.png")
    assert seen.shape == (SIZE[1], SIZE[0], 3)
    for path in folder.iterdir():
        path.unlink()


def test_objects_are_missed_only_where_there_are_none(
    user: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before the scene is read nobody is asked to add some."""
    user.press("Scene")
    user.at_rest()
    user.engine.editor.remove(["cube"])
    user.until(lambda: not user.engine.objects)
    user.hover("##fov")
    user.screen.wheel(-20)  # to the end
    user.until(lambda: user.reads("None yet"))
    monkeypatch.setattr(user.ui.viewport, "poll", lambda: None)
    user.until(lambda: user.reads("Objects") and not user.reads("None yet"))
