"""The words of both viewers: all things have some, and they are sentences."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from iprt.aovs import AOVS
from iprt.geometry.material import MaterialKind
from iprt.output.display import Curve
from iprt.settings.methods import methods
from iprt.viewer import labels
from iprt.viewer.lens import BUFFERS
from iprt.viewer.picking import Readout
from iprt.viewer.screenshots import default_folder, free_path
from iprt.viewer.state import PlaybackMode


def test_everything_has_a_name_and_a_tooltip() -> None:
    groups = (
        (BUFFERS, AOVS),
        (labels.CURVES, get_args(Curve)),
        (labels.comparisons(), ["input", "truth", "snapshot", *methods()]),
        (labels.MATERIALS, get_args(MaterialKind)),
        (labels.PLAYBACK, get_args(PlaybackMode)),
    )
    for found, expected in groups:
        assert list(found) == list(expected)


@pytest.mark.parametrize("known", [False, True])
def test_values_of_a_pixel_have_separators_and_units(known: bool) -> None:
    readout = Readout(
        3,
        4,
        np.float32([0.5, 0.25, 1e-5]),
        "hit_distance",
        np.float32([0.0]),
        "m",
        1.5 if known else None,
        np.array([0.0, 1.0, 0.0]) if known else None,
        "cube" if known else None,
    )
    start = "pixel 3, 4; linear RGB 0.5, 0.25, 1e-05; reflection distance 0 m"
    rest = "; distance 1.500 m; normal +0.00, +1.00, +0.00; object cube"
    text = "; ".join(f"{name} {value}" for name, value in readout.rows())
    assert text == start + (rest if known else "")


def test_screenshots_go_to_the_users_pictures(
    tmp_path: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_PICTURES_DIR", str(tmp_path))
    folder = default_folder()
    assert folder.parent == tmp_path
    first = free_path("room", "a/b", ".png")
    assert first == folder / "room-a_b-0001.png"
    assert not folder.exists()
    folder.mkdir()
    first.touch()
    assert free_path("room", "a/b", ".png") == folder / "room-a_b-0002.png"
    assert free_path("room", None, ".exr", folder) == folder / "room-view-0001.exr"
