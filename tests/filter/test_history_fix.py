"""The history fix against its twin and its promises."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.filter.history_fix import HistoryFix
from iprt.filter.signals import Kind, Signal, signal_planes
from iprt.filter.temporal import Accumulated
from iprt.settings.filter import AtrousSettings
from tests.filter.gbuffer import SIZES, GBuffer, flat_gbuffer, random_gbuffer, read, upload
from tests.oracles.guide import Array, falloff, shifted

SETTINGS = AtrousSettings(normal_sharpness=24.0)
ENOUGH = 1.5


def run(
    device: ComputeDevice,
    gbuffer: GBuffer,
    kind: Kind,
    signal: Array,
    variance: Array,
    length: Array,
    level: Array | None = None,
) -> tuple[Array, Array]:
    """`level`: of tracing; None: every pixel."""
    layout = gbuffer.layout
    levels = np.zeros_like(length) if level is None else level
    signal_of_guide = Signal("test", kind, gbuffer.guide(device))
    fix = HistoryFix(device, signal_of_guide, SETTINGS, ENOUGH)
    fixed, varied = fix.run(
        Accumulated(
            upload(device, layout, signal),
            upload(device, layout, np.stack([variance, length])),
        ),
        device.upload("level", layout.padded(levels[None]).astype(np.uint8)),
    )
    return read(device, layout, fixed), read(device, layout, varied)[0]


def twin(
    gbuffer: GBuffer, signal: Array, variance: Array, length: Array, level: Array
) -> tuple[Array, Array]:
    """Tap by tap over whole pictures, once for each stride that some pixel takes."""
    equirect, normal, position = gbuffer.equirect, gbuffer.normal, gbuffer.position
    ids = gbuffer.seen_ids
    fixed = (ids > 0) & (length > 0) & (length < np.where(level == 2, ENOUGH / 6.0, ENOUGH))
    widest = min(14.0, len(length) / 36.0)
    strides = np.maximum(np.floor(widest / (1.0 + length) + 0.5).astype(int), 1)
    result, varied = signal.copy(), variance.copy()
    for stride in np.unique(strides[fixed]):
        total, weights, variances = length * signal, length.copy(), length**2 * variance
        for i in range(25):
            by = (stride * (i % 5 - 2), stride * (i // 5 - 2), equirect)
            if i == 12:
                continue
            near = shifted(ids, *by, fill=-1.0) == ids
            turn = 1.0 - (normal * shifted(normal, *by)).sum(0)
            off = np.abs((normal * (shifted(position, *by) - position)).sum(0))
            depth = np.maximum(np.linalg.norm(position, axis=0), 1e-15)
            alike = falloff(24.0 * np.maximum(turn, 0.0) + 100.0 * off / depth)
            weight = np.where(near, shifted(length, *by) * alike, 0.0)
            total += weight * shifted(signal, *by)
            weights += weight
            variances += weight**2 * shifted(variance, *by)
        here = fixed & (strides == stride)
        result[:, here] = total[:, here] / weights[here]
        varied[here] = variances[here] / weights[here] ** 2
    return result, varied


@pytest.mark.parametrize(
    ("kind", "equirect"), [("ratio", False), ("delta", True), ("diffuse", False), ("diffuse", True)]
)
@pytest.mark.parametrize(("width", "height"), [*SIZES, (40, 256)])
def test_equals_twin(
    device: ComputeDevice, width: int, height: int, equirect: bool, kind: Kind
) -> None:
    rng = np.random.default_rng(4)
    gbuffer = random_gbuffer(width, height, equirect=equirect)
    signal = gbuffer.listed * rng.gamma(4.0, 0.25, (signal_planes(kind), height, width))
    variance = gbuffer.listed * rng.gamma(2.0, 0.05, (height, width))
    length = rng.choice([0.0, 1 / 16, 0.2, 0.3, 1.0, 2.0, 40.0], (height, width))
    level = rng.choice([0, 1, 2, 3, 255], (height, width))
    fixed = run(device, gbuffer, kind, signal, variance, length, level)
    wanted = twin(gbuffer, signal, variance, length, level)
    for result, expected in zip(fixed, wanted, strict=True):
        np.testing.assert_allclose(result, expected, rtol=2e-3, atol=1e-5)


def test_long_histories_keep_their_bits(device: ComputeDevice) -> None:
    gbuffer = flat_gbuffer(48, 32)
    rng = np.random.default_rng(5)
    signal = rng.random((3, 32, 48)).astype(np.float32)
    length = np.where(rng.random((32, 48)) < 0.5, 0.5, 1.5)
    result, _ = run(device, gbuffer, "diffuse", signal, np.ones((32, 48)), length)
    same = (result == signal).all(0)
    assert (same == (length == 1.5)).all()


def test_noise_falls_as_told(device: ComputeDevice) -> None:
    """Over a flat wall the mean stays, and the scatter of the result is what its variance says."""
    gbuffer = flat_gbuffer(256, 256)
    rng = np.random.default_rng(7)
    signal = np.repeat(rng.exponential(1.0, (1, 256, 256)), 3, axis=0)
    length = rng.choice([0.25, 1.0], (256, 256))
    signal = 1.0 + (signal - 1.0) / np.sqrt(length)
    result, variance = run(device, gbuffer, "diffuse", signal, 1.0 / length, length)
    inner = np.s_[64:-64, 64:-64]
    error = result[0][inner] - 1.0
    assert variance[inner].max() < 0.2
    scatter = np.mean(error**2 / variance[inner])
    assert abs(scatter - 1.0) < 0.1
    assert abs(error.mean()) < 0.02
