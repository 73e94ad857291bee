"""Captions of comparisons: they name, and score, the pictures that are compared."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from iprt.measure import metrics
from iprt.output.display import display
from iprt.viewer.displayed_frame import PictureDeveloper
from iprt.viewer.lens import Lens
from tests.waiting import DEADLINE_S

RNG = np.random.default_rng(5)
COLOR, INPUT, OTHER = RNG.random((3, 24, 32, 3)).astype(np.float32)
NORMAL = RNG.normal(size=(24, 32, 3)).astype(np.float32)
SCENE: Any = SimpleNamespace(exposure=1.0, views={})


def shown(color: Any, method: str, *, plain: bool = False) -> Any:
    aovs = {} if plain else {"background": INPUT, "normal": NORMAL}
    return SimpleNamespace(
        picture=SimpleNamespace(color=color, aovs=aovs),
        plain=plain,
        refined=not plain,
        frame=0,
        request=SimpleNamespace(
            view="ahead", objects=None, settings=SimpleNamespace(method=method)
        ),
    )


def developed(developer: PictureDeveloper, lens: Lens, baseline: Any) -> Any:
    return developer.develop(SCENE, None, lens, shown(COLOR, "iprt"), baseline, ())


@pytest.fixture
def developer() -> Any:
    developer = PictureDeveloper()
    yield developer
    developer.close()


def scored(developer: PictureDeveloper, lens: Lens, baseline: Any) -> str:
    """The caption once its score is known."""
    before, end = developer.scores, time.monotonic() + DEADLINE_S
    developed(developer, lens, baseline)
    while developer.scores == before and time.monotonic() < end:
        time.sleep(0.01)
    caption: str = developed(developer, lens, baseline).caption
    return caption


def test_scores_are_of_what_is_compared(developer: PictureDeveloper) -> None:
    ibl = shown(OTHER, "ibl")
    for against, other in (("input", INPUT), ("ibl", OTHER)):
        value = metrics.ssim(*(display(image, 1.0) for image in (COLOR, other)))
        caption = scored(developer, Lens(against=against), ibl)
        assert caption.endswith(f", SSIM {value:.3f}")


def test_a_method_whose_kernels_compile_is_not_compared_with(developer: PictureDeveloper) -> None:
    """Meanwhile its picture is the input."""
    found = developed(developer, Lens(against="ibl", split=0.0), shown(INPUT, "ibl", plain=True))
    assert "ibl is being rendered" in found.caption
    assert "SSIM" not in found.caption
    assert found.sides is None
    np.testing.assert_array_equal(found.pixels, Lens().develop(COLOR, 1.0))


def test_buffers_have_no_score(developer: PictureDeveloper) -> None:
    lens = Lens(buffer="normal", against="input")
    scored(developer, Lens(against="input"), None)
    found = developed(developer, lens, None)
    assert found.buffer == "normal"
    assert "SSIM" not in found.caption
