"""OpenCL implementations show the same pictures: that of `IPRT_TEST_DEVICE`, and PoCL.

Their rounding differs, so that a few rays meet something else; what is shown may hardly differ.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.output.display import display
from tests.frame.shown import CASES, shown, shown_elsewhere

pytestmark = pytest.mark.gl

LEVELS, SHARE = 2.0 / 255.0, 0.999
"""So far may displayed colors of this share of the pixels be apart."""
MEAN_LEVELS = 0.1 / 255.0
"""And of all pixels on average: few rays meet something else."""

LIKE_OTHERS = ("chart", "train", "dpt", "ibl", "iprt2023")
"""Cases whose kernels other cases launch, too."""

Picture = NDArray[np.float32]


def require_alike(one: Picture, other: Picture, what: str) -> None:
    """Two linear pictures, at an exposure that shows them well."""
    exposure = 0.4 / float(other.mean())
    apart = np.abs(display(one, exposure) - display(other, exposure)).max(-1)
    share = float((apart <= LEVELS).mean())
    told = f"{what}: {255 * apart.mean():.3f}/255 on average, {255 * apart.max():.1f}/255 at most"
    assert share >= SHARE, f"{told}, at most {255 * LEVELS:.0f}/255 on {share:.4f} of the pixels"
    assert apart.mean() <= MEAN_LEVELS, told


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, marks=pytest.mark.thorough if case in LIKE_OTHERS else ())
        for case in CASES
    ],
)
def test_pictures_agree(device: ComputeDevice, case: str, tmp_path: Path) -> None:
    """Scenes, each method, and a walk over a video that changes."""
    if "pocl" in device.device.platform.vendor.lower():
        pytest.skip("compares with PoCL: IPRT_TEST_DEVICE=intel, or ./run rusticl")
    wanted = shown_elsewhere(case, tmp_path)
    if wanted is None:
        pytest.skip("needs PoCL (pip install iprt[pocl])")
    for step, pictures in enumerate(zip(shown(device, case), wanted, strict=True)):
        require_alike(*pictures, f"picture {step}")


def test_differences_are_found() -> None:
    """Few pixels that are far apart, and many that are a little; not single ones."""
    picture = np.random.default_rng(0).random((96, 96, 3)).astype(np.float32)
    other = picture.copy()
    other[40, 50:55] *= 0.9
    require_alike(other, picture, "five pixels")
    other[40, 55:60] *= 0.9
    with pytest.raises(AssertionError, match="of the pixels"):
        require_alike(other, picture, "ten pixels")
    with pytest.raises(AssertionError, match="on average"):
        require_alike(1.003 * picture, picture, "brighter by 0.3%")
