"""Limit on computed highlights, `cl/world/real/highlight_gain.cl`, per cell of the panorama."""

from __future__ import annotations

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.material import Material, material_table
from iprt.world.real.highlight_gain import HighlightGain
from tests.oracles.highlight_gain import REACH, _blurred, highlight_gain

Float = NDArray[np.float64]
Gloss = NDArray[np.int64]

MATERIALS = (
    Material("plastic", alpha=0.2),
    Material("conductor", alpha=0.1),
    Material("plastic", alpha=0.0),
)


def limited(
    device: ComputeDevice, seen: Float, specular: Float, irradiance: Float, gloss: Gloss
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Gain and least remainder, (rows, columns, 4), as the device finds them."""
    table = device.upload("materials", material_table(MATERIALS))
    limit = HighlightGain(device, *gloss.shape, table, len(MATERIALS))
    limit.place((gloss > 0).any(axis=1))
    parts = (
        np.concatenate([part, fourth[..., None]], axis=-1).astype(np.float32)
        for part, fourth in ((seen, gloss), (specular, 0 * gloss), (irradiance, 0 * gloss))
    )
    limit.run(*(device.upload("cells", part) for part in parts))
    return device.read(limit.gain), device.read(limit.min_base)


def cells(specular: Float, diffuse: float = 0.2) -> tuple[Float, Float, Float, NDArray[np.int64]]:
    """Seen, computed, irradiance and gloss of a floor in even light, in the lower half."""
    gloss = np.zeros(specular.shape[:2], np.int64)
    gloss[8:] = 1
    irradiance = np.where(gloss[..., None] > 0, 1.5, 0.0) * np.ones(3)
    seen = np.where(gloss[..., None] > 0, diffuse * irradiance + specular, 0.0)
    return seen, np.where(gloss[..., None] > 0, specular, 0.0), irradiance, gloss


def glow(peak: tuple[float, float, float]) -> Float:
    """(16, 32, 3): a highlight about the cell (12, 10)."""
    y, x = np.mgrid[:16, :32]
    return np.asarray(np.exp(-((y - 12) ** 2 + (x - 10) ** 2) / 8.0)[..., None] * peak)


def test_a_highlight_that_was_seen_stays(device: ComputeDevice) -> None:
    seen, specular, irradiance, gloss = cells(glow((3.0, 2.0, 1.0)))
    gain, _ = limited(device, seen, specular, irradiance, gloss)
    bright = specular.min(-1) > 0.05
    np.testing.assert_allclose(gain[bright][:, :3], 1.0, atol=0.05)


def test_a_highlight_is_held_to_what_was_seen_of_it(device: ComputeDevice) -> None:
    """The sky in the window's reflection was guessed four times too red, and twice too green."""
    seen, specular, irradiance, gloss = cells(glow((3.0, 2.0, 1.0)))
    guessed = specular * (4.0, 2.0, 1.0)
    gain, least = limited(device, seen, guessed, irradiance, gloss)
    np.testing.assert_allclose(gain[12, 10, :3], (0.25, 0.5, 1.0), atol=0.05)
    np.testing.assert_allclose(least[12, 10, :3], 0.5 * 0.2 * 1.5, rtol=0.05)


def test_textures_do_not_pass_for_highlights(device: ComputeDevice) -> None:
    """Dark and light boards: the gain stays what it is on an even floor."""
    seen, specular, irradiance, gloss = cells(glow((1.0, 1.0, 1.0)))
    boards = 1.0 + 0.3 * np.sign(np.sin(np.arange(32) * 2.0))[None, :, None]
    gain, _ = limited(device, (seen - specular) * boards + specular, specular, irradiance, gloss)
    assert gain[10:15, 8:13, :3].min() > 0.9


@pytest.mark.parametrize("rows", [slice(0, 20), slice(3, 9), slice(17, 18), slice(0, 0)])
def test_it_is_what_numpy_computes(device: ComputeDevice, rows: slice) -> None:
    """Patches of three materials, one a conductor, across +-180 degrees; dark cells among them."""
    random = np.random.default_rng(1)
    gloss = np.zeros((20, 40), np.int64)
    gloss[rows] = np.repeat(random.integers(0, 4, (20, 10)), 4, axis=1)[rows]
    seen, specular, irradiance = random.random((3, 20, 40, 3)) * [1.0, 0.5, 2.0]
    specular[:, ::3] *= 0.2
    specular[:, 7] = 0.0
    irradiance[:, 20:28] = 0.0
    inside = (gloss > 0)[..., None]
    parts = (np.where(inside, part, 0.0) for part in (seen, specular, irradiance))
    seen, specular, irradiance = (part.astype(np.float32).astype(np.float64) for part in parts)
    coated = np.where(gloss == 2, 0, gloss)
    found = limited(device, seen, specular, irradiance, gloss)
    for part, wanted in zip(found, highlight_gain(seen, specular, irradiance, coated), strict=True):
        np.testing.assert_allclose(part, wanted, rtol=3e-5, atol=3e-5)


def test_few_faint_cells_are_no_quantile(device: ComputeDevice) -> None:
    """Less than a tenth: the quantile is of all cells; from there on, of the faint ones alone."""
    gloss = np.ones((4, 10), np.int64)
    irradiance = np.ones((4, 10, 3))
    for faint, expected in ((3, 0.1), (4, 0.8)):
        seen, specular = np.full((2, 4, 10, 3), 1.0)
        specular *= 0.9
        specular.reshape(-1, 3)[:faint] = 0.2
        _, least = limited(device, seen, specular, irradiance, gloss)
        np.testing.assert_allclose(least[..., :3], 0.5 * expected, rtol=1e-4)


@pytest.mark.parametrize("shape", [(9, 18, 3), (2, 4, 3)])
def test_means_wrap_around_in_azimuth_only(shape: tuple[int, ...]) -> None:
    cells = np.random.default_rng(0).random(shape)
    mode = ("nearest", "wrap", "nearest")
    expected = scipy.ndimage.gaussian_filter(cells, (REACH, REACH, 0), mode=mode)
    np.testing.assert_allclose(_blurred(cells), expected, rtol=1e-12)
