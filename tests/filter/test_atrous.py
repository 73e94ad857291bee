"""The à-trous filter against its twin and its promises."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.filter.atrous import Atrous
from iprt.filter.signals import Kind, Signal, signal_planes
from iprt.geometry.camera import View
from iprt.settings.filter import AtrousSettings
from tests.filter.gbuffer import SIZES, GBuffer, flat_gbuffer, random_gbuffer, read, upload
from tests.oracles import atrous as oracle

SETTINGS = AtrousSettings(
    levels=5,
    normal_sharpness=24.0,
    deviations=6.0,
    lobe_fraction=0.5,
)


def rounding(device: ComputeDevice, of_floats: float) -> float:
    """Relative error of a value that goes from level to level as it is."""
    return 2.0**-11 if device.half_planes else of_floats


def run(
    device: ComputeDevice,
    gbuffer: GBuffer,
    kind: Kind,
    signal: np.ndarray,
    variance: np.ndarray,
    *,
    roughness: np.ndarray | None = None,
    settings: AtrousSettings | None = None,
    guided: bool = True,
    radiance: float = 1.0,
    length: np.ndarray | float = 1.0,
) -> np.ndarray:
    layout = gbuffer.layout
    settings = settings or SETTINGS
    signals = [Signal("test", kind, gbuffer.guide(device))]
    atrous = Atrous(device, signals, settings, guided=guided)
    certainty = np.stack([variance, np.broadcast_to(length, variance.shape)])
    planes = ([upload(device, layout, signal)], [upload(device, layout, certainty)])
    alpha = None if roughness is None else upload(device, layout, roughness[None])
    (filtered,) = atrous.run(*planes, roughness=[alpha], radiance=radiance)
    return read(device, layout, filtered)


def twin(
    gbuffer: GBuffer,
    kind: Kind,
    signal: np.ndarray,
    variance: np.ndarray,
    levels: int = 5,
    roughness: np.ndarray | None = None,
    guided: bool = True,
    length: np.ndarray | float = 1.0,
) -> np.ndarray:
    args = (gbuffer.normal, gbuffer.position, gbuffer.seen_ids)
    if roughness is not None:
        sharp = np.broadcast_to(np.asarray(length) < 3.5, roughness.shape)
        sharp = sharp if guided else np.ones_like(sharp)
        guide = gbuffer.normal, gbuffer.seen_ids, gbuffer.equirect
        roughness = oracle.widened(roughness, *guide, exempt=sharp)
    variance = oracle.smooth_variance(variance, gbuffer.seen_ids, gbuffer.equirect)
    for level in range(levels):
        signal, variance = oracle.filter_level(
            signal,
            variance,
            *args,
            1 << level,
            roughness=roughness,
            delta=kind == "delta",
            guided=guided,
            equirect=gbuffer.equirect,
        )
    return signal


def random_case(
    kind: Kind, width: int, height: int, equirect: bool
) -> tuple[GBuffer, np.ndarray, np.ndarray, np.ndarray | None]:
    rng = np.random.default_rng(2)
    gbuffer = random_gbuffer(width, height, equirect=equirect)
    signal = gbuffer.listed * rng.gamma(4.0, 0.25, (signal_planes(kind), height, width))
    variance = gbuffer.listed * rng.gamma(2.0, 0.05, (height, width))
    roughness = None
    if kind == "specular":
        roughness = rng.choice([0.0, 5e-5, 0.05, 0.3, 1.0], (height, width))
    return gbuffer, signal, variance, roughness


@pytest.mark.parametrize(
    ("kind", "equirect"),
    [("ratio", False), ("delta", True), ("diffuse", False), ("specular", True)],
)
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_equals_twin(
    device: ComputeDevice, width: int, height: int, equirect: bool, kind: Kind
) -> None:
    gbuffer, signal, variance, roughness = random_case(kind, width, height, equirect)
    length = np.random.default_rng(3).choice([1.0, 3.0, 4.0, 16.0], (height, width))
    for guided in (True, False):
        given: dict[str, Any] = {"roughness": roughness, "guided": guided, "length": length}
        result = run(device, gbuffer, kind, signal, variance, **given)
        expected = twin(gbuffer, kind, signal, variance, **given)
        np.testing.assert_allclose(result, expected, rtol=5e-3, atol=1e-4)


def test_equal_planes_stay_equal(device: ComputeDevice) -> None:
    gbuffer, signal, variance, _ = random_case("ratio", 61, 47, False)
    signal[3:] = signal[:3]
    for v in (variance, 0.0 * variance):
        result = run(device, gbuffer, "ratio", signal, v)
        assert np.array_equal(result[:3], result[3:])
        assert not np.array_equal(result, signal)


@pytest.mark.parametrize("equirect", [False, True])
def test_zeros_stay_zeros(device: ComputeDevice, equirect: bool) -> None:
    """Pixels beyond the filter's reach, and pixels that objects touched before."""
    gbuffer = flat_gbuffer(160, 128)
    if equirect:
        view = View(160, 128, projection="equirect")
        gbuffer = replace(gbuffer, view=view, depth=np.full_like(gbuffer.depth, 2.0))
    atrous = Atrous(device, [Signal("test", "delta", gbuffer.guide(device))], SETTINGS)
    rng = np.random.default_rng(11)
    for x, y in [(70, 60), (2, 3), (155, 120), (90, 100)]:
        signal, variance = np.zeros((6, 128, 160)), np.zeros((128, 160))
        signal[:, y - 2 : y + 3, x - 2 : x + 3] = rng.random((6, 5, 5))
        variance[y - 2 : y + 3, x - 2 : x + 3] = 0.1
        planes = [[upload(device, gbuffer.layout, image)] for image in (signal, variance[None])]
        result = read(device, gbuffer.layout, atrous.run(*planes, radiance=1.0)[0])
        expected = twin(gbuffer, "delta", signal, variance)
        np.testing.assert_allclose(result, expected, rtol=5e-3, atol=1e-6)
        row, column = np.mgrid[:128, :160]
        across = np.abs(column - x)
        across = np.minimum(across, 160 - across) if equirect else across
        assert not result[:, np.maximum(across, np.abs(row - y)) > 2 + 31].any()
    planes = [[upload(device, gbuffer.layout, np.zeros((n, 128, 160)))] for n in (6, 1)]
    assert not read(device, gbuffer.layout, atrous.run(*planes, radiance=1.0)[0]).any()


def test_mirror_is_not_touched(device: ComputeDevice) -> None:
    """If it is flat, or has few samples: the spread of neighbours is no noise then."""
    gbuffer, signal, variance, _ = random_case("specular", 64, 48, False)
    mirror = np.zeros((48, 64))
    for of, length in ((gbuffer, 1.0), (flat_gbuffer(64, 48), 16.0)):
        result = run(device, of, "specular", signal, variance, roughness=mirror, length=length)
        np.testing.assert_allclose(result, signal.astype(np.float32), rtol=rounding(device, 0.0))
    result = run(device, gbuffer, "specular", signal, variance, roughness=mirror, length=16.0)
    assert (np.abs(result - signal) > 0.01).mean() > 0.2


@pytest.mark.parametrize("exponent", [-20, 20])
def test_brightness_of_the_scene_does_not_count(device: ComputeDevice, exponent: int) -> None:
    gbuffer, signal, variance, roughness = random_case("specular", 64, 48, False)
    factor = 2.0**exponent
    same, scaled = (
        run(
            device,
            gbuffer,
            "specular",
            by * signal,
            by**2 * variance,
            roughness=roughness,
            radiance=by * 0.7,
        )
        for by in (1.0, factor)
    )
    assert np.array_equal(factor * same, scaled)


@pytest.mark.parametrize("radiance", [0.003, 1.0, 1.999, 700.0])
def test_highlights_of_the_sun_and_dim_corners_are_kept(
    device: ComputeDevice, radiance: float
) -> None:
    """A disc of the sun's size that sends all light is as bright as any; more is cut off."""
    sun = radiance / (np.pi * np.radians(0.533 / 2.0) ** 2 / (4.0 * np.pi))
    gbuffer = flat_gbuffer(64, 48)
    signal = np.broadcast_to([[[sun]], [[1e-3 * radiance]], [[1e6 * sun]]], (3, 48, 64))
    result = run(device, gbuffer, "diffuse", signal, np.zeros((48, 64)), radiance=radiance)
    np.testing.assert_allclose(result[:2], signal[:2], rtol=rounding(device, 2e-6))
    assert np.isfinite(result).all()
    assert (result[2] > sun).all()


def test_what_is_not_finite_stays_so(device: ComputeDevice) -> None:
    """The published filter is given such samples; they are dropped behind it."""
    gbuffer, signal, variance, _ = random_case("diffuse", 64, 48, False)
    signal[:, 20, 30], signal[:, 30, 20] = np.inf, np.nan
    gbuffer.ids[[20, 30], [30, 20]] = 0.0
    result = run(device, gbuffer, "diffuse", signal, variance)
    assert not np.isfinite(result[:, [20, 30], [30, 20]]).any()


def test_noise_goes_and_known_detail_stays(device: ComputeDevice) -> None:
    """A step of 10% vanishes in noise of one picture, and survives the mean of 256."""
    gbuffer = flat_gbuffer(96, 64)
    rng = np.random.default_rng(5)
    truth = np.where(np.arange(96) < 48, 1.0, 0.9) * np.ones((3, 64, 96))
    errors = {}
    for frames in (1, 256):
        deviation = 0.5 / np.sqrt(frames)
        signal = truth + deviation * rng.normal(size=(1, 64, 96))
        result = run(device, gbuffer, "diffuse", signal, np.full((64, 96), deviation**2))
        errors[frames] = np.sqrt(np.mean((result - truth) ** 2))
        assert errors[frames] < 0.3 * deviation
        step = result[0, :, 40:46].mean() - result[0, :, 50:56].mean()
        assert frames == 1 or abs(step - 0.1) < 0.005
    assert errors[256] < 0.1 * errors[1] or errors[256] < 0.006


@pytest.mark.parametrize("kind", ["ratio", "diffuse"])
def test_extreme_values_stay_finite(device: ComputeDevice, kind: Kind) -> None:
    gbuffer, signal, variance, _ = random_case(kind, 64, 48, False)
    rng = np.random.default_rng(6)
    signal *= 10.0 ** rng.choice([-30, -5, 0, 6, 12], signal.shape)
    variance *= 10.0 ** rng.choice([-35, 0, 12, 24], variance.shape)
    assert np.isfinite(run(device, gbuffer, kind, signal, variance)).all()


def test_equirect_picture_turns_with_the_view(device: ComputeDevice) -> None:
    gbuffer, signal, variance, _ = random_case("ratio", 64, 32, True)
    signal *= gbuffer.seen_ids > 0.0
    result = run(device, gbuffer, "ratio", signal, variance)
    turned = run(device, gbuffer.rolled(7), "ratio", np.roll(signal, 7, 2), np.roll(variance, 7, 1))
    np.testing.assert_allclose(np.roll(result, 7, 2), turned, rtol=2e-3, atol=1e-5)
