"""Temporal accumulation against its twin and its promises."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant, float_constant
from iprt.filter.signals import Kind, signal_planes
from iprt.filter.temporal import (
    FAST_FRAMES,
    FAST_LEAST,
    FAST_LENGTH,
    MOVED_TOLERANCE,
    OUTLIER,
    PLANE_TOLERANCE,
    SETTLE_FRAMES,
)
from iprt.geometry.camera import Projection, View
from tests.filter.gbuffer import GBuffer, flat_gbuffer, random_gbuffer
from tests.filter.session import SETTINGS, Session, noise
from tests.oracles import temporal as oracle
from tests.oracles.guide import shown

GUIDE_ID = constant("lib/gbuffer/guide.h", "GUIDE_ID")
SLEEPING = float_constant("lib/gbuffer/guide.h", "SLEEPING")
LEVEL_WAITING = constant("lib/gbuffer/guide.h", "LEVEL_WAITING")


@pytest.mark.parametrize(
    ("kind", "equirect"), [("ratio", True), ("delta", False), ("diffuse", True)]
)
@pytest.mark.parametrize(("width", "height"), [(1, 1), (7, 13), (36, 20)])
def test_equals_twin(
    device: ComputeDevice, width: int, height: int, equirect: bool, kind: Kind
) -> None:
    rng = np.random.default_rng(5)
    gbuffer = random_gbuffer(width, height, equirect=equirect)
    session = Session(device, gbuffer, kind)
    before = gbuffer
    past = fast = empty = oracle.History(
        np.zeros((signal_planes(kind), height, width)),
        np.zeros((height, width)),
        np.zeros((height, width)),
    )
    age = -1  # of the fast history, which starts anew after some frames
    for frame, (changed, fading) in enumerate(
        [(False, 0.0)] * 3 + [(True, 0.0), (True, 0.1), (False, 0.1)] + [(True, 0.1)] * 6
    ):
        signal = noise(rng, kind, width, height)
        signal *= np.where(rng.random((height, width)) < 0.05, 30.0, 1.0)
        motion = session.still + rng.normal(size=(2, height, width)) * [[[0.8]], [[0.6]]]
        if equirect:
            motion[0] %= width
        motion[:, rng.random((height, width)) < 0.05] = -1e9
        ids = np.where(rng.random((height, width)) < 0.02, 0.0, gbuffer.ids)
        now = replace(gbuffer, ids=ids)
        level = rng.integers(0, 4, (height, width))
        result = session.add(now, signal, motion, level, fading=fading, changed=changed)
        tolerance = PLANE_TOLERANCE
        if changed and kind == "diffuse":
            tolerance = MOVED_TOLERANCE
        limits = (tolerance, SETTINGS.normal_agreement)
        sample = signal
        if fading > 0.0 and kind == "diffuse":
            sample = oracle.limited(signal, now.seen_ids, OUTLIER, equirect)
        past = oracle.reproject(now.planes, before.planes, motion, past, limits, equirect)
        age = age + 1 if age >= 0 or changed else -1
        if age >= 0:
            fast = empty if age % FAST_FRAMES == 0 else fast
            fast = oracle.reproject(now.planes, before.planes, motion, fast, limits, equirect)
            fast = oracle.follow(fast, signal, now.seen_ids, level, FAST_LENGTH)
        if age >= 0 and (age < FAST_FRAMES or age % FAST_FRAMES >= FAST_LEAST - 1):
            past = oracle.correct(past, fast, now.seen_ids, 3.0, equirect)
            common = kind == "ratio"
            past = oracle.clamp(past, fast.signal, now.seen_ids, 2.0, equirect, common=common)
        past = oracle.accumulate(past, sample, now.seen_ids, level, fading)
        variance = oracle.variance(past, now.seen_ids, equirect)
        # A value on a threshold may fall on either side of it in single precision.
        for image, twin in [
            (result.signal, past.signal),
            (result.certainty, np.stack([variance, past.length])),
        ]:
            close = np.isclose(session.image(image), twin, rtol=2e-3, atol=2e-4)
            # What follows builds on it.
            assert (~close).sum() <= 1 + 0.002 * (frame + 1) * close.size, frame
        before = now


@pytest.mark.parametrize("projection", ["perspective", "equirect"])
def test_reflections_are_resampled_by_a_spline(
    device: ComputeDevice, projection: Projection
) -> None:
    """Next to the border and to pixels without history, bilinearly."""
    rng = np.random.default_rng(6)
    width, height = 72, 36
    equirect = projection == "equirect"
    view = View(width, height, projection=projection)
    normal = -np.moveaxis(view.directions(), -1, 0)
    gbuffer = GBuffer(view, normal, np.full((height, width), 2.0), np.ones((height, width)))
    before = replace(gbuffer, ids=np.where(rng.random((height, width)) < 0.01, 0.0, 1.0))
    session = Session(device, before, "specular")
    signal = noise(rng, "specular", width, height)
    session.add(before, signal)
    motion = session.still + rng.uniform(-0.9, 0.9, (2, height, width))
    motion[0] %= width if equirect else np.inf
    # Waiting pixels keep their history.
    waiting = np.full((height, width), LEVEL_WAITING)
    result = session.image(session.add(gbuffer, signal, motion, waiting).signal)
    planes, limits = before.planes, (PLANE_TOLERANCE, SETTINGS.normal_agreement)
    known = oracle.History(signal, before.ids, np.zeros((height, width)))
    past, bilinear = (
        oracle.reproject(gbuffer.planes, planes, motion, known, limits, equirect, spline=spline)
        for spline in (True, False)
    )
    assert (np.abs(past.signal - bilinear.signal) > 0.01).any(axis=0).mean() > 0.5
    seen = past.length > 0.0
    close = np.isclose(result[:, seen], past.signal[:, seen], rtol=1e-3, atol=1e-3)
    assert (~close).mean() < 0.002


def test_a_turning_head_does_not_blur_reflections(device: ComputeDevice) -> None:
    """After 24 fractional steps, stripes of four pixels keep most of their contrast."""
    gbuffer = flat_gbuffer(64, 24)
    session = Session(device, gbuffer, "specular")
    x = np.arange(64) + 0.5
    waiting = np.full((24, 64), LEVEL_WAITING)

    def stripes(shift: float) -> np.ndarray:
        return np.broadcast_to(1.0 + 0.5 * np.sin(2.0 * np.pi * (x - shift) / 8.0), (3, 24, 64))

    result = session.add(gbuffer, stripes(0.0))
    motion = session.still - np.array([0.4, 0.0])[:, None, None]
    for _ in range(24):
        result = session.add(gbuffer, stripes(0.0), motion, waiting)
    middle = (slice(None), slice(4, 20), slice(20, 56))
    kept = session.image(result.signal)[middle] - 1.0
    ideal = stripes(24 * 0.4)[middle] - 1.0
    # By bilinear lookups, less than a fifth.
    assert (kept * ideal).sum() > 0.55 * (ideal**2).sum()


@pytest.mark.parametrize(("kind", "slept"), [("delta", 8.0), ("diffuse", 8.0), ("ratio", 0.0)])
def test_a_pixel_that_wakes_had_no_influence(
    device: ComputeDevice, kind: Kind, slept: float
) -> None:
    """Its first sample does not flash. Where E_R is unknown, it has no history."""
    gbuffer = flat_gbuffer(40, 24)
    session = Session(device, gbuffer, kind)
    signal = noise(np.random.default_rng(8), kind, 40, 24)
    session.add(gbuffer, signal)
    planes = session.guide.current.get()
    planes[GUIDE_ID] = np.where(planes[GUIDE_ID] > 0.0, SLEEPING, planes[GUIDE_ID])
    device.write(session.guide.current, planes)
    woken = session.add(gbuffer, signal)
    np.testing.assert_allclose(session.image(woken.signal), signal / (slept + 1.0), rtol=1e-5)
    np.testing.assert_allclose(session.image(woken.certainty)[1], slept + 1.0)


@pytest.mark.parametrize("kind", ["ratio", "delta", "diffuse"])
def test_still_picture_converges_to_the_mean(device: ComputeDevice, kind: Kind) -> None:
    rng = np.random.default_rng(6)
    gbuffer = flat_gbuffer(40, 24)
    session = Session(device, gbuffer, kind)
    samples = [noise(rng, kind, 40, 24) for _ in range(30)]
    for signal in samples:
        result = session.add(gbuffer, signal)
    np.testing.assert_allclose(session.image(result.signal), np.mean(samples, 0), rtol=3e-6)
    assert np.all(session.image(result.certainty)[1] == 30.0)
    scalars = np.array([shown(s) for s in samples])
    variance = (1.0 + 8.0 / 30.0) * scalars.var(0, ddof=1) / 30.0
    np.testing.assert_allclose(session.image(result.certainty)[0], variance, rtol=1e-3, atol=1e-9)


@pytest.mark.parametrize(("fading", "signed"), [(0.1, False), (0.1, True), (0.0, False)])
def test_lone_bright_samples_are_limited_where_the_mean_fades(
    device: ComputeDevice, fading: float, signed: bool
) -> None:
    """The mean of all frames keeps its energy, and so do changes of either sign."""
    gbuffer = flat_gbuffer(24, 24)
    session = Session(device, gbuffer, "specular", signed=signed)
    signal = np.full((3, 24, 24), 0.5)
    signal[:, 12, 12] = 100.0
    signal[:, 4:6, 4:6] = 100.0  # no outlier: its neighbours are as bright
    shown = session.image(session.add(gbuffer, signal, fading=fading).signal)
    kept = fading == 0.0 or signed
    signal[:, 12, 12] = 100.0 if kept else OUTLIER * 0.5
    np.testing.assert_allclose(shown, signal, rtol=1e-5)


def test_fading_after_stillness_and_back(device: ComputeDevice) -> None:
    """A faded history is worth (2 - f) / f samples, so the mean that follows weighs it right."""
    gbuffer = flat_gbuffer(8, 8)
    session = Session(device, gbuffer, "diffuse")
    rng = np.random.default_rng(7)
    for _ in range(60):
        result = session.add(gbuffer, rng.random((3, 8, 8)), fading=0.1)
    np.testing.assert_allclose(session.image(result.certainty)[1], 19.0)
    result = session.add(gbuffer, rng.random((3, 8, 8)), fading=0.0)
    np.testing.assert_allclose(session.image(result.certainty)[1], 20.0)


def test_other_surface_is_rejected(device: ComputeDevice) -> None:
    gbuffer = flat_gbuffer(40, 24)
    session = Session(device, gbuffer, "diffuse")
    dark, bright = np.zeros((3, 24, 40)), np.ones((3, 24, 40))
    for _ in range(5):
        session.add(gbuffer, dark)
    ids, depth, normal = gbuffer.ids.copy(), gbuffer.depth.copy(), gbuffer.normal.copy()
    ids[:, :10] = 2.0
    depth[:, 10:20] *= 1.1
    normal[:, :, 20:30] = np.array([1.0, 0.0, 0.0])[:, None, None]
    result = session.add(replace(gbuffer, ids=ids, depth=depth, normal=normal), bright)
    expected = np.where(np.arange(40) < 30, 1.0, 6.0)
    assert np.array_equal(session.image(result.certainty)[1], np.tile(expected, (24, 1)))
    np.testing.assert_allclose(session.image(result.signal)[..., :30], 1.0)


@pytest.mark.parametrize("kind", ["ratio", "delta"])
def test_old_shadow_goes_at_once(device: ComputeDevice, kind: Kind) -> None:
    """To the last bit, so that the video passes unchanged where the object was."""
    gbuffer = flat_gbuffer(40, 24)
    session = Session(device, gbuffer, kind)
    rng = np.random.default_rng(9)
    for _ in range(20):
        signal = rng.gamma(2.0, 0.5, (6, 24, 40))
        if kind == "ratio":
            signal[3:] = 0.5 * signal[:3]
        session.add(gbuffer, signal)
    signal = np.tile(signal[:3], (2, 1, 1)) if kind == "ratio" else np.zeros_like(signal)
    accumulated = session.add(gbuffer, signal, fading=0.1, changed=True)
    result = session.image(accumulated.signal)
    assert np.array_equal(result[:3], result[3:])
    assert kind == "ratio" or not result.any()


@pytest.mark.parametrize("before", [0.0, 0.3, 1.0])
def test_ghosts_last_eight_frames_at_most(device: ComputeDevice, before: float) -> None:
    """A seventh at most is left of noisy light that steps to 0.6 after a long time."""
    gbuffer = flat_gbuffer(64, 48)
    session = Session(device, gbuffer, "diffuse")
    rng = np.random.default_rng(14)

    def samples(chance: float) -> np.ndarray:
        return np.repeat(rng.random((1, 48, 64)) < chance, 3, axis=0).astype(float)

    for _ in range(60):
        session.add(gbuffer, samples(before))
    for frame in range(8):
        result = session.add(gbuffer, samples(0.6), fading=0.1, changed=frame == 0)
    left = session.image(result.signal).mean() - 0.6
    assert abs(left) < 0.15 * abs(before - 0.6)


def test_change_elsewhere_costs_little(device: ComputeDevice) -> None:
    """A long history keeps most of its weight while objects move elsewhere."""
    gbuffer = flat_gbuffer(64, 48)
    session = Session(device, gbuffer, "diffuse")
    rng = np.random.default_rng(15)
    for frame in range(60):
        signal = 1.0 + 0.5 * rng.normal(size=(1, 48, 64)) * np.ones((3, 1, 1))
        result = session.add(gbuffer, signal, changed=frame >= 30)
    image = session.image(result.signal)[0]
    assert abs(image.mean() - 1.0) < 0.01
    assert image.std() < 2.0 * 0.5 / np.sqrt(60)
    assert np.median(session.image(result.certainty)[1]) > 30.0


def test_published_filter_is_its_twin(device: ComputeDevice) -> None:
    """A tenth of each frame; the history within the frame's neighbourhoods, in every frame."""
    rng = np.random.default_rng(17)
    gbuffer = random_gbuffer(40, 30, equirect=False)
    session = Session(device, gbuffer, "delta", published=True)
    zeros = np.zeros((30, 40))
    past, ids = oracle.History(np.zeros((6, 30, 40)), zeros, zeros), gbuffer.seen_ids
    for _ in range(6):
        signal = noise(rng, "delta", 40, 30)
        result = session.add(gbuffer, signal)
        clamped = oracle.clamp(past, signal, ids, 2.0, False, common=False)
        past = replace(past, signal=clamped.signal)
        past = oracle.accumulate(past, signal, ids, zeros, 0.1)
    close = np.isclose(session.image(result.signal), past.signal, rtol=1e-3, atol=1e-4)
    assert (~close).sum() <= 0.005 * close.size


def test_histories_agree_again(device: ComputeDevice) -> None:
    """From `SETTLE_FRAMES` after a change on, all frames count alike."""
    gbuffer = flat_gbuffer(8, 8)
    session = Session(device, gbuffer, "diffuse")
    rng = np.random.default_rng(16)
    for frame in range(SETTLE_FRAMES + 1):
        result = session.add(gbuffer, rng.random((3, 8, 8)), changed=frame == 1)
    past, length = session.image(result.signal), session.image(result.certainty)[1]
    sample = rng.random((3, 8, 8))
    result = session.add(gbuffer, sample)
    expected = past + (sample - past) / (length + 1.0)
    np.testing.assert_allclose(session.image(result.signal), expected, rtol=1e-5)


def test_equal_planes_stay_equal(device: ComputeDevice) -> None:
    gbuffer = random_gbuffer(33, 21, equirect=False)
    session = Session(device, gbuffer, "ratio")
    rng = np.random.default_rng(10)
    for changed in (False, True, True, False):
        signal = np.tile(rng.gamma(2.0, 0.5, (3, 21, 33)), (2, 1, 1))
        motion = session.still + rng.normal(size=(2, 21, 33))
        result = session.add(gbuffer, signal, motion, fading=0.1, changed=changed)
    image = session.image(result.signal)
    assert np.array_equal(image[:3], image[3:])
    assert not session.image(result.certainty)[0].any()


@pytest.mark.parametrize("changed", [False, True])
def test_samples_that_are_not_finite_are_dropped(device: ComputeDevice, changed: bool) -> None:
    gbuffer = flat_gbuffer(16, 8)
    session = Session(device, gbuffer, "diffuse")
    values = (0.5, 0.9, 0.3, 0.1, 0.7)
    for value, bad in zip(values, (np.nan, np.inf, 1.0, -np.inf, 1.0), strict=True):
        signal = np.full((3, 8, 16), value)
        signal[1, 3:5, 4:9] *= bad
        result = session.add(gbuffer, signal, changed=changed)
    image = session.image(result.signal)
    assert np.isfinite(image).all()
    assert np.isfinite(session.image(result.certainty)[0]).all()
    assert session.image(result.certainty)[1, 4, 6] == 2.0
    if not changed:
        np.testing.assert_allclose(image[:, 4, 6], 0.5, rtol=1e-6)


@pytest.mark.parametrize("changed", [False, True])
def test_reset_forgets(device: ComputeDevice, changed: bool) -> None:
    """Both histories are reset: the fast one would restore the slow one."""
    gbuffer = flat_gbuffer(16, 8)
    session = Session(device, gbuffer, "diffuse")
    session.add(gbuffer, np.zeros((3, 8, 16)), changed=changed)
    session.temporal.reset()
    for _ in range(3):
        result = session.add(gbuffer, np.ones((3, 8, 16)), changed=changed)
        assert np.all(session.image(result.signal) == 1.0)


def test_equirect_picture_turns_with_the_view(device: ComputeDevice) -> None:
    """A pan of an equirect view keeps the whole history, across the seam too."""
    gbuffer = random_gbuffer(64, 32, equirect=True)
    rng = np.random.default_rng(12)
    signal = rng.random((3, 32, 64)).astype(np.float32)
    session = Session(device, gbuffer, "diffuse")
    session.add(gbuffer, signal)
    motion = session.still.copy()
    motion[0] = (motion[0] - 7.0) % 64
    result = session.add(gbuffer.rolled(7), np.full_like(signal, np.nan), motion)
    image = session.image(result.signal)
    assert np.array_equal(image, np.roll(np.where(gbuffer.seen_ids > 0, signal, 0), 7, 2))


def test_frames_weigh_as_their_rays(device: ComputeDevice) -> None:
    """Eight frames of four rays a pixel, then one a frame: the mean is over all rays."""
    gbuffer = flat_gbuffer(64, 48)
    session = Session(device, gbuffer, "diffuse", rays=4)
    rng = np.random.default_rng(8)
    for rays in [4] * 8 + [1] * 24:
        noise = rng.normal(0.0, 1.0 / np.sqrt(rays), (1, 48, 64))
        result = session.add(gbuffer, np.repeat(1.0 + noise, 3, axis=0))
    assert (session.image(result.certainty)[1] == 8 + 24 / 4).all()
    # 56 rays of variance 1; one error for all three channels.
    error = session.image(result.signal)[0] - 1.0
    assert abs(56 * np.mean(error**2) - 1.0) < 0.1
    told = session.image(result.certainty)[0].mean() / (1.0 + 8.0 / 14.0)
    assert abs(56 * told - 1.0) < 0.15
