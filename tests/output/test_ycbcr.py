"""Y'CbCr as BT.709 has it, against the formulas, and where chroma lies."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.output.ycbcr import ycbcr420


def decoded(planes: NDArray[np.generic], bits: int) -> NDArray[np.float64]:
    """(H, W, 3) R'G'B' by the equations of BT.709-6, items 3.2 to 3.4; chroma interpolated."""
    height = planes.shape[0] * 2 // 3
    step = 2.0 ** (bits - 8)
    luma = (planes[:height] / step - 16.0) / 219.0
    chroma = (planes[height:] / step - 128.0) / 224.0
    cb, cr = chroma.reshape(2, height // 2, -1)
    rows = (np.arange(height) - 0.5) / 2.0
    columns = np.arange(planes.shape[1]) / 2.0

    def full(plane: NDArray[np.float64]) -> NDArray[np.float64]:
        across = np.stack([np.interp(columns, np.arange(len(line)), line) for line in plane])
        down = [np.interp(rows, np.arange(len(line)), line) for line in across.T]
        return np.stack(down, axis=1)

    red = luma + 1.5748 * full(cr)
    blue = luma + 1.8556 * full(cb)
    return np.stack([red, (luma - 0.2126 * red - 0.0722 * blue) / 0.7152, blue], axis=-1)


@pytest.mark.parametrize(("bits", "step"), [(8, 1), (10, 4), (16, 256)])
@pytest.mark.parametrize(
    ("color", "codes"),
    [
        ((0, 0, 0), (16, 128, 128)),
        ((1, 1, 1), (235, 128, 128)),
        ((0, 0, 1), (16 + 219 * 0.0722, 240, 128 - 224 * 0.0722 / 1.5748)),
        ((1, 0, 0), (16 + 219 * 0.2126, 128 - 224 * 0.2126 / 1.8556, 240)),
    ],
)
def test_colors_have_the_codes_of_the_standard(
    color: tuple[float, ...], codes: tuple[float, ...], bits: int, step: int
) -> None:
    planes = ycbcr420(np.full((4, 6, 3), color, np.float64), bits)
    assert planes.shape == (6, 6)
    expected = np.rint(np.array(codes) * step)
    found = planes[0, 0], planes[4, 0], planes[5, 0]
    assert np.abs(np.array(found, float) - expected).max() <= (0 if bits == 8 else 1)
    assert all(np.ptp(part) == 0 for part in (planes[:4], planes[4:5], planes[5:]))


@pytest.mark.parametrize(("bits", "error"), [(8, 1.0), (10, 0.3)])
def test_smooth_pictures_survive_without_a_shift(bits: int, error: float) -> None:
    """In steps of 8 bits; a shift of chroma by half a column would be 0.7 on these."""
    y, x = np.mgrid[0:32, 0:64]
    picture = np.stack([x / 90.0, y / 40.0, 0.9 - x / 80.0], axis=-1)
    off = (decoded(ycbcr420(picture, bits), bits) - picture)[2:-2, 2:-2] * 255.0
    assert np.abs(off).mean() < error
    assert np.abs(off.mean(axis=(0, 1))).max() < 0.1


def test_an_edge_of_color_stays_where_it_is() -> None:
    picture = np.zeros((4, 16, 3))
    picture[:, 8:] = (1.0, 0.0, 0.0)
    red = ycbcr420(picture, 8)[4:].reshape(2, 2, 8)[1]
    assert np.array_equal(red[0], red[1])
    assert np.allclose(red[0, [0, 3, 5, 7]], [128, 128, 240, 240], atol=0.5)
    assert red[0, 4] == pytest.approx(128 + 0.75 * 112, abs=0.6), "a quarter of it lies left"
