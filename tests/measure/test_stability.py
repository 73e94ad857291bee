"""Flicker and trails of sequences whose flicker and trails are known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.measure.results import json_text
from iprt.measure.stability import (
    KINDS,
    LEVEL,
    MIN_PIXELS,
    FlickerMeter,
    Trail,
    TrailMeter,
    compensated,
    left_behind,
    pixel_kinds,
    taken,
    was_so,
)

Float = NDArray[np.float64]
H, W = 40, 60


def still() -> Float:
    """Motion (H, W, 2) of a view in which nothing moves: each pixel's own centre."""
    y, x = np.mgrid[0:H, 0:W] + 0.5
    return np.stack([x, y], axis=-1)


def texture(dx: float = 0.0) -> Float:
    """A smooth picture (H, W, 3), moved to the right by `dx` pixels."""
    y, x = np.mgrid[0:H, 0:W].astype(float)
    waves = [0.5 + 0.3 * np.sin(0.3 * (x - dx) + 0.2 * y + phase) for phase in (0.0, 1.0, 2.0)]
    return np.stack(waves, axis=-1)


def everywhere(kind: str) -> dict[str, NDArray[np.bool_]]:
    return {name: np.full((H, W), name == kind) for name in KINDS}


def test_kinds_of_pixels() -> None:
    coverage = np.array([[0.0, 0.0, 0.0, 1.0, 0.5]])
    ratio, change = np.ones((1, 5, 3)), np.zeros((1, 5, 3))
    ratio[0, 1, 2] = np.nextafter(1.0, 2.0)
    change[0, 2, 0] = -1e-9
    kinds = pixel_kinds(coverage, ratio, change)
    np.testing.assert_array_equal(kinds["untouched"], [[True, False, False, False, False]])
    np.testing.assert_array_equal(kinds["relit"], [[False, True, True, False, False]])
    np.testing.assert_array_equal(kinds["object"], [[False, False, False, True, False]])
    np.testing.assert_array_equal(
        pixel_kinds(coverage, ratio, np.zeros((1, 5)))["untouched"],
        [[True, False, True, False, False]],
    )


def test_what_moves_by_whole_pixels_comes_back_to_the_bit() -> None:
    """Also with a projection's rounding, and at the border."""
    rng = np.random.default_rng(1)
    before = rng.random((H, W, 3))
    motion = still() + np.array([-3.0, 2.0]) + 1e-5 * rng.normal(size=(H, W, 2))
    found, inside = compensated(before, motion)
    np.testing.assert_array_equal(found[:-2, 3:], before[2:, :-3])
    assert inside[:-2, 3:].all()
    assert not inside[-2:].any()
    assert not inside[:, :3].any()


def test_what_moves_by_parts_of_pixels_is_interpolated() -> None:
    """Bilinear: exact on planes."""
    y, x = np.mgrid[0:H, 0:W] + 0.5
    motion = still() + np.array([0.3, -0.6])
    found, inside = compensated((2.0 * x + 3.0 * y)[..., None], motion)
    wanted = 2.0 * motion[..., 0] + 3.0 * motion[..., 1]
    np.testing.assert_allclose(found[inside][:, 0], wanted[inside])
    assert inside.mean() > 0.9


def test_a_pixel_was_so_where_all_of_it_was() -> None:
    before = np.zeros((H, W), bool)
    before[:, :30] = True
    found = was_so(before, still() + np.array([0.4, 0.0]))
    assert found[:, :29].all()
    assert not found[:, 29:].any()
    assert not was_so(before, np.full((H, W, 2), -1e9)).any()


@pytest.mark.parametrize("steps", [(3.0, -1.0), (0.0, 0.0)], ids=["moves", "stands"])
def test_a_picture_that_only_moves_does_not_flicker(steps: tuple[float, float]) -> None:
    meter, motion = FlickerMeter(), still() - [*steps]
    for frame in range(4):
        y, x = np.mgrid[0:H, 0:W]
        pattern = np.random.default_rng(0).random((400, 400, 3))
        shown = pattern[100 + y - int(steps[1]) * frame, 100 + x - int(steps[0]) * frame]
        meter.add(shown, shown, everywhere("object"), motion)
    found = meter.result("object")
    assert (found.output, found.reference, found.ratio) == (0.0, 0.0, 1.0)
    assert found.pixels == 3 * (H - abs(int(steps[1]))) * (W - abs(int(steps[0])))


def test_noise_flickers_by_what_it_is() -> None:
    """Two normal deviates differ by 2 σ / sqrt(π) in the mean; each kind is counted by itself."""
    rng = np.random.default_rng(2)
    kinds = everywhere("untouched")
    kinds["relit"] = np.mgrid[0:H, 0:W][1] >= W // 2
    kinds["untouched"] = ~kinds["relit"]
    sigma = np.where(kinds["relit"], 0.02, 0.01)[..., None]
    meter, frames = FlickerMeter(), 30
    for frame in range(frames):
        scene = texture(2.0 * frame)
        shown = scene + sigma * rng.normal(size=(H, W, 3))
        motion = still() - [2.0, 0.0]
        # Where there is nothing to compare with, pictures do not count.
        truth = scene + 0.005 * rng.normal(size=(H, W, 3)) if frame not in (0, 7) else None
        meter.add(shown if truth is not None else 0.0 * shown, truth, kinds, motion)
    for kind, deviation in (("untouched", 0.01), ("relit", 0.02)):
        found = meter.result(kind)
        assert found.output == pytest.approx(2.0 * deviation / np.sqrt(np.pi), rel=0.02)
        assert found.reference == pytest.approx(2.0 * 0.005 / np.sqrt(np.pi), rel=0.02)
        assert found.ratio == pytest.approx(deviation / 0.005, rel=0.04)
    none = meter.result("object")
    assert (none.pixels, json_text(none.ratio)) == (0, "null")


def test_pixels_that_change_their_kind_are_left_out() -> None:
    meter, motion = FlickerMeter(), still()
    black = np.zeros((H, W, 3))
    meter.add(black, black, everywhere("relit"), motion)
    now = everywhere("relit")
    now["object"][:, :20] = True
    now["relit"][:, :20] = False
    meter.add(np.where(now["object"][..., None], 1.0, black), black, now, motion)
    assert meter.result("object").pixels == 0
    assert meter.result("relit").output == 0.0
    assert meter.result("relit").pixels == H * (W - 20)


def test_what_has_left() -> None:
    """An object, a real thing near or far, and a shadow; not what is covered or stays."""
    columns = 7
    before = {
        "coverage": np.array([[0.3, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]]),
        "depth": np.array([[1.0, 1.0, 2.0, 2.0, 1.0, 2.0, 2.0]]),
        "ratio": np.ones((1, columns, 3)),
    }
    now = {
        "coverage": np.array([[0.0, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0]]),
        "depth": np.array([[1.0, 2.0, 1.0, 2.0, 2.0, 2.02, 2.0]]),
        "ratio": np.ones((1, columns, 3)),
    }
    before["ratio"][0, 3] = 0.8
    before["ratio"][0, 6] = now["ratio"][0, 6] = 0.8
    left = left_behind(before, now)
    assert {cause: np.flatnonzero(mask).tolist() for cause, mask in left.items()} == {
        "object": [0], "real": [1, 2], "light": [3],
    }  # fmt: skip
    assert np.flatnonzero(taken(before)).tolist() == [0, 3, 4, 6]
    assert np.flatnonzero(taken(now)).tolist() == [4, 6]


def film_with_a_trail(keep: float, sigma: float, frames: int = 24) -> Trail:
    """A bar moves over the picture; of what it leaves, a share `keep` is left in each frame more.

    As in any film, noise goes down as the square root of the frames since something changed.
    """
    rng, meter = np.random.default_rng(4), TrailMeter()
    ground, bar = np.full((H, W, 3), 0.5), np.full((H, W, 3), 0.9)
    ghost, age = np.zeros((H, W, 3)), np.full((H, W), -1)
    before = np.zeros((H, W), bool)
    for frame in range(frames):
        covered = np.zeros((H, W), bool)
        covered[:, 2 * frame : 2 * frame + 6] = True
        converged = np.where(covered[..., None], bar, ground)
        left = before & ~covered
        ghost = np.where(left[..., None], bar - ground, ghost) * keep
        ghost[covered] = 0.0
        age = np.where(left, 0, age + 1)
        noise = sigma / np.sqrt(1.0 + age)[..., None] * rng.normal(size=(H, W, 3))
        shown = converged + ghost + noise
        meter.add(shown, converged, left=left, taken=covered)
        before = covered
    return meter.result()


@pytest.mark.parametrize("keep", [0.0, 0.5, 0.8])
def test_a_trail_is_as_long_as_it_is_seen(keep: float) -> None:
    """Without noise, until what is left of the bar is less than a step of the display."""
    trail = film_with_a_trail(keep, 0.0)
    known = [age for age in trail.ages if age.pixels >= MIN_PIXELS]
    assert len(known) > 15
    for index, age in enumerate(known):
        assert age.ghost == pytest.approx(keep ** (index + 1), abs=0.05)
    seen = sum(0.4 * keep ** (index + 1) > LEVEL for index in range(24))
    assert trail.frames is not None
    assert abs(trail.frames - seen) <= 1


def test_noise_is_no_trail() -> None:
    """However strong; and a trail in it ends where it drowns."""
    for sigma in (0.01, 0.1):
        trail = film_with_a_trail(0.0, sigma)
        assert trail.frames == 0
        assert max(abs(age.ghost) for age in trail.ages[:10]) < 0.1
    clean, noisy = (film_with_a_trail(0.8, sigma).frames for sigma in (0.0, 0.1))
    assert clean is not None
    assert noisy is not None
    assert 2 < noisy < clean


def test_a_trail_that_does_not_end_has_no_length() -> None:
    assert film_with_a_trail(1.0, 0.0).frames is None


def test_where_nothing_leaves_there_is_no_trail() -> None:
    meter, nowhere = TrailMeter(), np.zeros((H, W), bool)
    for _ in range(3):
        meter.add(texture(), texture(), left=nowhere, taken=nowhere)
    assert meter.result().frames is None
