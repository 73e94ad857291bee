"""Metrics against definitions, and images that must not be scored."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
from numpy.typing import NDArray
from skimage.metrics import structural_similarity

from iprt.errors import FormatError
from iprt.files.images import srgb_encode
from iprt.measure import metrics
from iprt.output.display import display

Image = NDArray[np.float64]


@pytest.fixture
def pair() -> tuple[Image, Image]:
    """A noisy picture and its truth, 40x60, display-referred."""
    rng = np.random.default_rng(7)
    y, x = np.mgrid[:40, :60]
    truth = np.stack([x / 60, y / 40, (x + y) / 100], axis=-1)
    return np.clip(truth + rng.normal(0, 0.05, truth.shape), 0, 1), truth


def ssim_oracle(test: Image, truth: Image) -> float:
    """Wang et al. 2004, equations 13 to 17, by explicit sums over 11x11 windows."""
    offsets = np.arange(-5, 6)
    weight = np.exp(-(offsets**2) / (2 * 1.5**2))
    weight = np.outer(weight, weight) / weight.sum() ** 2
    scores = []
    for channel in range(3):
        for j in range(5, truth.shape[0] - 5):
            for i in range(5, truth.shape[1] - 5):
                a = test[j - 5 : j + 6, i - 5 : i + 6, channel]
                b = truth[j - 5 : j + 6, i - 5 : i + 6, channel]
                mean_a, mean_b = (weight * a).sum(), (weight * b).sum()
                var_a = (weight * a * a).sum() - mean_a**2
                var_b = (weight * b * b).sum() - mean_b**2
                cov = (weight * a * b).sum() - mean_a * mean_b
                scores.append(
                    (2 * mean_a * mean_b + 1e-4)
                    * (2 * cov + 9e-4)
                    / ((mean_a**2 + mean_b**2 + 1e-4) * (var_a + var_b + 9e-4))
                )
    return float(np.mean(scores))


@pytest.mark.parametrize(
    ("linear", "encoded"),
    [
        (0.0, 0.0),
        (0.0031308, 0.0404500),  # IEC 61966-2-1: where line and power meet
        (0.001, 0.01292),
        (0.0048963, 0.06),
        (0.18, 0.4613561),
        (0.2140411, 0.5),
        (0.5, 0.7353570),
        (1.0, 1.0),
    ],
)
def test_srgb_matches_the_standard(linear: float, encoded: float) -> None:
    assert srgb_encode(np.array([linear]))[0] == pytest.approx(encoded, abs=2e-6)


def test_display_exposes_then_clips() -> None:
    radiance = np.array([[[0.107020568, 40.0, -1.0]]], np.float32)
    np.testing.assert_allclose(display(radiance, 2.0)[0, 0], [0.5, 1.0, 0.0], atol=1e-6)


def test_identical_images_are_perfect(pair: tuple[Image, Image]) -> None:
    _, truth = pair
    assert metrics.ssim(truth, truth) == pytest.approx(1.0, abs=1e-12)
    assert metrics.mse(truth, truth) == 0.0
    assert metrics.psnr(truth, truth) == math.inf
    score = metrics.flip(truth, truth)
    assert score is None or score == pytest.approx(0.0, abs=1e-6)


def test_mse_and_psnr_of_a_known_offset() -> None:
    truth = np.full((12, 13, 3), 0.4)
    assert metrics.mse(truth + 0.1, truth) == pytest.approx(0.01)
    assert metrics.psnr(truth + 0.1, truth) == pytest.approx(20.0)


def test_ssim_is_the_published_formula(pair: tuple[Image, Image]) -> None:
    test, truth = (image[:24, :26] for image in pair)
    assert metrics.ssim(test, truth) == pytest.approx(ssim_oracle(test, truth), abs=1e-9)


def test_cuts_are_cropped_before_scoring(pair: tuple[Image, Image]) -> None:
    _, truth = pair
    test = truth.copy()
    test[:, 40:] = 1.0 - test[:, 40:]  # wrong, but only to the right of the cut
    x0, y0, x1, y1 = cut = (10, 5, 40, 35)
    _, score_map = structural_similarity(
        test,
        truth,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        data_range=1,
        channel_axis=2,
        full=True,
    )
    cropped_map = float(score_map[y0:y1, x0:x1].mean())
    (score,) = metrics.ssim_cuts(test, truth, [cut])
    assert score == pytest.approx(1.0, abs=1e-12)
    assert cropped_map < 0.99


def test_several_cuts_keep_their_order(pair: tuple[Image, Image]) -> None:
    cuts = [(0, 0, 20, 20), (30, 10, 60, 40)]
    expected = [metrics.ssim(*(im[y0:y1, x0:x1] for im in pair)) for x0, y0, x1, y1 in cuts]
    assert metrics.ssim_cuts(*pair, cuts) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_non_finite_radiance_is_refused(value: float) -> None:
    radiance = np.zeros((16, 16, 3), np.float32)
    radiance[3, 4, 1] = value
    with pytest.raises(FormatError, match="1 pixels with NaN or infinite"):
        display(radiance)


@pytest.mark.parametrize("name", ["mse", "psnr", "ssim", "flip"])
@pytest.mark.parametrize("bad", ["nan", "nan_in_both", "size", "range", "gray"])
def test_images_that_cannot_be_compared_are_refused(
    name: str, bad: str, pair: tuple[Image, Image]
) -> None:
    test, truth = pair[0].copy(), pair[1].copy()
    if bad.startswith("nan"):
        test[0, 0, 0] = np.nan
    if bad == "nan_in_both":
        truth[0, 0, 0] = np.nan
    if bad == "size":
        test = test[:, 1:]
    if bad == "range":
        test[5, 5] = 1.5
    if bad == "gray":
        test, truth = test[..., 0], truth[..., 0]
    with pytest.raises(FormatError):
        getattr(metrics, name)(test, truth)


@pytest.mark.parametrize("cut", [(0, 0, 10, 30), (0, 0, 30, 10)])
def test_cut_smaller_than_the_window_is_refused(
    cut: metrics.Cut, pair: tuple[Image, Image]
) -> None:
    with pytest.raises(FormatError, match=r"the cut .* too few for SSIM"):
        metrics.ssim_cuts(*pair, [cut])
    x0, y0, x1, y1 = cut
    assert len(metrics.ssim_cuts(*pair, [(x0, y0, max(x1, 11), max(y1, 11))])) == 1


@pytest.mark.parametrize(
    "cut",
    [
        *((-1, 0, 20, 20), (0, 0, 61, 20), (0, 0, 20, 41)),
        *((30, 0, 10, 20), (30, 0, 30, 20), (0, 10, 20, 10)),
    ],
)
def test_cut_outside_the_image_is_refused(cut: metrics.Cut, pair: tuple[Image, Image]) -> None:
    with pytest.raises(FormatError, match="not inside the 60x40 image"):
        metrics.ssim_cuts(*pair, [cut])


def test_flip_needs_its_package(monkeypatch: pytest.MonkeyPatch, pair: tuple[Image, Image]) -> None:
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    assert metrics.flip(*pair) is None
    assert metrics.flip_map(*pair) is None


@pytest.mark.flip
def test_the_map_of_flip_shows_where_images_differ() -> None:
    pytest.importorskip("flip_evaluator")
    truth = np.full((64, 128, 3), 0.5)
    test = truth.copy()
    test[:, :32] = 1.0
    found = metrics.flip_map(test, truth)
    assert found is not None
    assert found.shape == truth.shape
    same = metrics.flip_map(truth, truth)
    assert same is not None
    np.testing.assert_array_equal(found[:, 64:], same[:, 64:])
    assert (np.abs(found - same)[:, :28].max(axis=-1) > 0.1).all()


@pytest.mark.flip
def test_flip_grows_with_the_error(pair: tuple[Image, Image]) -> None:
    pytest.importorskip("flip_evaluator")
    test, truth = pair
    small, large = metrics.flip(0.5 * (test + truth), truth), metrics.flip(test, truth)
    assert small is not None
    assert large is not None
    assert 0.0 < small < large < 1.0
    black, white = np.zeros((16, 16, 3)), np.ones((16, 16, 3))
    # The largest possible lightness difference is near the top of the scale.
    assert metrics.flip(black, white) == pytest.approx(0.98, abs=0.02)
