"""The device's pictures and sums of light, against NumPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.world.real import surfaces
from iprt.world.real.cell_light import CellLight
from iprt.world.real.irradiance import SURFACES
from iprt.world.real.lights import Lights
from iprt.world.real.panorama import Panorama
from iprt.world.real.pictures import PictureLoader
from tests.oracles.light import cell_luminance, flux_change, frames_light_change, relit_grid
from tests.oracles.worlds import frame_of
from tests.world.real.lighting import uploaded

SIZES = [(16, 8), (37, 23), (40, 300), (64, 512)]
"""Some with strips that are not full."""


def picture(size: tuple[int, int], seed: int) -> NDArray[np.float32]:
    width, height = size
    return np.random.default_rng(seed).gamma(0.3, 2.0, (height, width, 3)).astype(np.float32)


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("share", [False, True], ids=["copied", "shared"])
@pytest.mark.parametrize("mapped", ["--", "mm", "-m-m", "-mm-"])
def test_texels_and_flux_are_those_of_numpy(
    device: ComputeDevice,
    size: tuple[int, int],
    share: bool,
    mapped: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(surfaces, "BAND_TEXELS", 256 * size[0])
    color_map = np.array([[1.2, -0.3, 0.0], [0.1, 0.9, 0.1], [0.0, 0.2, 0.7]])
    width, height = size
    loader = PictureLoader(device, width, height, share=share, color_map="m" in mapped)
    before = None
    for seed, way in enumerate(mapped):
        frame = replace(
            frame_of(np.ones(size[::-1])),
            color=picture(size, seed),
            color_map=color_map if way == "m" else None,
        )
        loader.load(frame.color, frame.color_map)
        np.testing.assert_array_equal(device.read(loader.color), frame.color)
        found = device.read(loader.radiance)
        np.testing.assert_allclose(found, frame.radiance, rtol=1e-5, atol=1e-6)
        rows = np.sin((np.arange(height) + 0.5) / height * np.pi)
        mean = np.average(frame.radiance.mean(axis=(1, 2)), weights=rows)
        flux = loader.flux()
        assert flux.mean == pytest.approx(mean, rel=1e-5)
        change = 0.0 if before is None else flux_change(before, frame.radiance)
        assert flux.change == pytest.approx(change, rel=1e-5)
        before = frame.radiance
    assert loader.flux().change > 0.5


def test_without_light_there_is_no_change(device: ComputeDevice) -> None:
    loader = PictureLoader(device, 16, 8, share=True, color_map=False)
    for _ in range(2):
        loader.load(np.zeros((8, 16, 3), np.float32))
        assert (loader.flux().mean, loader.flux().change) == (0.0, 0.0)


def test_strips_tell_which_texels_have_changed(device: ComputeDevice) -> None:
    size = width, height = 70, 8
    loader = PictureLoader(device, width, height, share=False, color_map=False)
    color = picture(size, 0)
    loader.load(color)
    assert (device.read(loader.sums)[..., 3] == 1.0).all()
    other = color.copy()
    other[2, 31, 1] += 0.5
    other[5, 64:] *= 2.0
    loader.load(other)
    wanted = np.zeros((height, 3))
    wanted[2, 0] = wanted[5, 2] = 1.0
    np.testing.assert_array_equal(device.read(loader.sums)[..., 3], wanted)


@pytest.mark.parametrize("size", [*SIZES, (1024, 300)], ids=str)
@pytest.mark.parametrize("remembered", [False, True])
def test_luminance_of_cells_is_that_of_numpy(
    device: ComputeDevice, size: tuple[int, int], remembered: bool
) -> None:
    color = picture(size, 1)
    hidden = np.random.default_rng(2).gamma(0.3, 2.0, size[::-1]).astype(np.float32)
    lights = Lights(device, *size)
    lights.load(uploaded(device, color), device.upload("hidden", hidden) if remembered else None)
    wanted = cell_luminance(color, lights.rows, lights.columns, hidden if remembered else None)
    np.testing.assert_allclose(device.read(lights.luminance), wanted, rtol=1e-5)


@pytest.mark.parametrize("size", [(16, 8), (37, 23), (256, 128), (300, 151)], ids=str)
def test_cells_are_relit_as_by_numpy(device: ComputeDevice, size: tuple[int, int]) -> None:
    """Surfaces that stay, that move, and sky that comes and goes."""
    rng = np.random.default_rng(4)
    depth = rng.uniform(1.0, 3.0, size[::-1])
    frames: list[Frame] = []
    for seed in range(2):
        frame = frame_of(np.where(rng.random(depth.shape) < 0.1, np.inf, depth))
        frames.append(replace(frame, color=picture(size, seed) + np.float32(0.1)))
        depth = depth * np.where(rng.random(depth.shape) < 0.3, 1.1, 1.001)
    rows = 16 if size[1] > 100 else 4
    panorama = Panorama(device, *size)
    light = CellLight(device, *size, rows)
    for frame in frames:
        panorama.load(frame)
        light.follow(panorama)
    factor, error = frames_light_change(*frames, rows)
    assert (factor != 1.0).mean() > 0.5
    factor, error = np.tile(factor, (SURFACES, 1)), np.tile(error, SURFACES)
    entries = len(error)
    mean, smooth = rng.gamma(1.0, 1.0, (2, 2 * entries, 4)).astype(np.float32)
    mean[:entries, 3] = samples = rng.integers(0, 500, entries)
    plane = rng.normal(size=(entries, 4)).astype(np.float32)
    plane[:, 3] = np.where(rng.random(entries) < 0.3, 0.0, 1.0)
    grids = {"plane": plane, "mean": mean, "smooth": smooth}
    held = {name: device.upload(name, grid) for name, grid in grids.items()}
    light.relight(panorama, panorama.flux.change, **held)
    wanted = {name: relit_grid(grids[name], factor) for name in ("mean", "smooth")}
    left = np.minimum(samples, error**-2.0)
    assert (left < samples).mean() > 0.1
    wanted["mean"][:entries, 3] = left
    wanted["plane"] = plane.astype(np.float64)
    wanted["plane"][plane[:, 3] > 0.0, 3] += (samples - left)[plane[:, 3] > 0.0]
    for name, twin in wanted.items():
        np.testing.assert_allclose(device.read(held[name]), twin, rtol=1e-3, atol=1e-5)
