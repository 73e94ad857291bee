"""How far a picture is from its truth: SSIM, PSNR, MSE and FLIP of display-referred images.

Radiance is compared as a viewer sees it: after exposure, clipping and the sRGB curve, in [0, 1].
A picture that cannot be scored raises; it never gets a number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError

Image = NDArray[np.float64]
Cut = tuple[int, int, int, int]

SSIM_SIGMA = 1.5
SSIM_WINDOW = 11
"""Pixels across the Gaussian window of SSIM: sigma 1.5 truncated at 3.5 sigma."""

FLIP_PPD = 67.0
"""Pixels per degree that FLIP assumes: a 0.7 m wide 3840-pixel display seen from 0.7 m."""


def mse(test: Image, truth: Image) -> float:
    """Mean squared error over pixels and channels of two display-referred images."""
    _require_comparable(test, truth)
    return float(np.mean(np.square(test - truth)))


def rmse(test: NDArray[Any], truth: NDArray[Any]) -> float:
    """Root of the mean squared error over pixels and channels of two images of linear radiance."""
    _require_same_size(test, truth)
    return float(np.sqrt(np.mean(np.square(test.astype(np.float64) - truth))))


def psnr(test: Image, truth: Image) -> float:
    """Peak signal-to-noise ratio in dB of two display-referred images; inf if they are equal."""
    error = mse(test, truth)
    return math.inf if error == 0.0 else -10.0 * math.log10(error)


def ssim(test: Image, truth: Image) -> float:
    """Mean structural similarity of two display-referred images, Gaussian window of 11 pixels.

    Source: Wang, Bovik, Sheikh, Simoncelli, "Image quality assessment: from error visibility to
    structural similarity", IEEE TIP 2004, with its parameters (sigma 1.5, population covariance),
    per colour channel.

    Raises
    ------
    FormatError
        Shapes differ, values leave [0, 1], or a side is shorter than the window.
    """
    from skimage.metrics import structural_similarity

    _require_comparable(test, truth)
    _require_window(truth.shape[1], truth.shape[0], "the image")
    return float(
        structural_similarity(
            truth,
            test,
            gaussian_weights=True,
            sigma=SSIM_SIGMA,
            use_sample_covariance=False,
            data_range=1.0,
            channel_axis=2,
        )
    )


def ssim_cuts(test: Image, truth: Image, cuts: Sequence[Cut]) -> tuple[float, ...]:
    """SSIM of each crop `x0, y0, x1, y1`, cropped first: no pixel outside a cut counts in it.

    Raises
    ------
    FormatError
        As `ssim`, or a cut leaves the image.
    """
    _require_comparable(test, truth)
    height, width = truth.shape[:2]
    check_cuts(cuts, width, height)
    return tuple(ssim(test[y0:y1, x0:x1], truth[y0:y1, x0:x1]) for x0, y0, x1, y1 in cuts)


def check_cuts(cuts: Sequence[Cut], width: int, height: int) -> None:
    """Fail if a cut `x0, y0, x1, y1` cannot be scored in an image of `width` x `height` pixels.

    Raises
    ------
    FormatError
        The cut leaves the image, or a side is shorter than the window of SSIM.
    """
    for cut in cuts:
        x0, y0, x1, y1 = cut
        if not (0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height):
            raise FormatError(f"the cut {list(cut)} is not inside the {width}x{height} image")
        _require_window(x1 - x0, y1 - y0, f"the cut {list(cut)}")


def flip(test: Image, truth: Image) -> float | None:
    """Mean LDR-FLIP of two display-referred images at 67 pixels per degree, 0 (equal) to 1.

    None where the package `flip_evaluator` (the extra `metrics`) is not installed.

    Source: Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", HPG 2020.
    """
    evaluated = _evaluate_flip(test, truth, colours=False)
    return None if evaluated is None else float(evaluated[1])


def flip_map(test: Image, truth: Image) -> Image | None:
    """(H, W, 3) where and how much two images differ by `flip`, in the colours of magma.

    None where the package `flip_evaluator` is not installed.
    """
    evaluated = _evaluate_flip(test, truth, colours=True)
    return None if evaluated is None else np.asarray(evaluated[0], np.float64)


def _evaluate_flip(test: Image, truth: Image, *, colours: bool) -> Any:
    """Error map, mean error and parameters; None without the evaluator."""
    # The evaluator drops NaN pixels from its mean in silence, so both images are checked here.
    _require_comparable(test, truth)
    try:
        import flip_evaluator
    except ImportError:
        return None
    return flip_evaluator.evaluate(
        np.ascontiguousarray(truth, np.float32),
        np.ascontiguousarray(test, np.float32),
        "LDR",
        inputsRGB=True,
        applyMagma=colours,
        parameters={"ppd": FLIP_PPD},
    )


def _require_same_size(test: NDArray[Any], truth: NDArray[Any]) -> None:
    if test.shape != truth.shape:
        sizes = ("x".join(map(str, (*i.shape[1::-1], *i.shape[2:]))) for i in (test, truth))
        raise FormatError("the images differ in size: {} against the truth's {}".format(*sizes))


def _require_comparable(test: Image, truth: Image) -> None:
    _require_same_size(test, truth)
    if truth.ndim != 3 or truth.shape[2] != 3 or truth.size == 0:
        raise FormatError(f"expected images of shape (H, W, 3), got {truth.shape}")
    for image in (test, truth):
        # Written so that NaN, which compares false, is rejected too.
        if not (image.min() >= 0.0 and image.max() <= 1.0):
            raise FormatError("the images are not display-referred: values outside [0, 1] or NaN")


def _require_window(width: int, height: int, what: str) -> None:
    if min(width, height) < SSIM_WINDOW:
        raise FormatError(
            f"{what} has {width}x{height} pixels, too few for SSIM: "
            f"its window needs {SSIM_WINDOW}x{SSIM_WINDOW}"
        )
