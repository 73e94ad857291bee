"""Image metrics: SSIM, PSNR, MSE and FLIP of display-referred images, RMSE of linear radiance.

Display-referred images are in [0, 1], after exposure, clipping and the sRGB curve. All functions
raise `FormatError` for images that cannot be compared.
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
"""Side in pixels of SSIM's Gaussian window: sigma 1.5 truncated at 3.5 sigma."""

FLIP_PPD = 67.0
"""Pixels per degree for FLIP: a 0.7 m wide 3840-pixel display seen from 0.7 m."""


def mse(test: Image, truth: Image) -> float:
    """Compute the mean squared error of two display-referred images over pixels and channels."""
    _require_comparable(test, truth)
    return float(np.mean(np.square(test - truth)))


def rmse(test: NDArray[Any], truth: NDArray[Any]) -> float:
    """Compute the root mean squared error of two linear images over pixels and channels."""
    _require_same_size(test, truth)
    return float(np.sqrt(np.mean(np.square(test.astype(np.float64) - truth))))


def psnr(test: Image, truth: Image) -> float:
    """Compute the PSNR in dB of two display-referred images; inf if they are equal."""
    error = mse(test, truth)
    return math.inf if error == 0.0 else -10.0 * math.log10(error)


def ssim(test: Image, truth: Image) -> float:
    """Compute the mean SSIM of two display-referred images, with a Gaussian window of 11 pixels.

    Source: Wang, Bovik, Sheikh, Simoncelli, "Image quality assessment: from error visibility to
    structural similarity", IEEE TIP 2004, with its parameters (sigma 1.5, population covariance),
    averaged over color channels.

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
    """Compute the SSIM of each cut `x0, y0, x1, y1`.

    Images are cropped first, so that pixels outside of a cut have no influence.

    Raises
    ------
    FormatError
        The images cannot be compared (see `ssim`), or a cut exceeds the image.
    """
    _require_comparable(test, truth)
    height, width = truth.shape[:2]
    check_cuts(cuts, width, height)
    return tuple(ssim(test[y0:y1, x0:x1], truth[y0:y1, x0:x1]) for x0, y0, x1, y1 in cuts)


def check_cuts(cuts: Sequence[Cut], width: int, height: int) -> None:
    """Check the cuts `x0, y0, x1, y1` of an image of `width` x `height` pixels.

    Raises
    ------
    FormatError
        A cut exceeds the image, or one of its sides is shorter than the window of SSIM.
    """
    for cut in cuts:
        x0, y0, x1, y1 = cut
        if not (0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height):
            raise FormatError(f"the cut {list(cut)} is not inside the {width}x{height} image")
        _require_window(x1 - x0, y1 - y0, f"the cut {list(cut)}")


def flip(test: Image, truth: Image) -> float | None:
    """Compute the mean LDR-FLIP of two display-referred images at 67 pixels per degree.

    The result is in [0, 1], 0 for equal images. It is None if the package `flip_evaluator` (extra
    `metrics`) is not installed.

    Source: Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", HPG 2020.
    """
    evaluated = _evaluate_flip(test, truth, colors=False)
    return None if evaluated is None else float(evaluated[1])


def flip_map(test: Image, truth: Image) -> Image | None:
    """Compute the FLIP error map of two images in the magma colormap, (H, W, 3).

    The result is None if the package `flip_evaluator` is not installed.
    """
    evaluated = _evaluate_flip(test, truth, colors=True)
    return None if evaluated is None else np.asarray(evaluated[0], np.float64)


def _evaluate_flip(test: Image, truth: Image, *, colors: bool) -> Any:
    """Return error map, mean error and parameters; None if the evaluator is not installed."""
    # The evaluator silently drops NaN pixels from its mean, so both images are checked here.
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
        applyMagma=colors,
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
        # `not` of a comparison also rejects NaN, which compares false.
        if not (image.min() >= 0.0 and image.max() <= 1.0):
            raise FormatError("the images are not display-referred: values outside [0, 1] or NaN")


def _require_window(width: int, height: int, what: str) -> None:
    if min(width, height) < SSIM_WINDOW:
        raise FormatError(
            f"{what} has {width}x{height} pixels, too few for SSIM: "
            f"its window needs {SSIM_WINDOW}x{SSIM_WINDOW}"
        )
