"""Errors of the raw estimates fall as one over the root of the samples: no bias, no heavy tails."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from tests.trace.estimators import ESTIMATORS, Estimator, furnace, kernels, lamps
from tests.trace.test_estimators import (
    BALL,
    BLACK,
    BOX_VIEW,
    MATERIALS,
    as_large,
    ball_factor,
    box_of,
    box_truth,
)
from tests.worlds import Float, ball

pytestmark = pytest.mark.thorough

MOST = 256
COUNTS = [1, 4, 16, 64, MOST]


def slope(errors: list[float]) -> float:
    """The slope of log error against log `COUNTS`, by least squares."""
    return float(np.polyfit(np.log(COUNTS), np.log(errors), 1)[0])


def rms(values: Float) -> float:
    return float(np.sqrt((values**2).mean()))


def slopes(draw: Callable[[int, int], Float], wanted: Float) -> tuple[float, float]:
    """Slope with independent seeds, a ray each, and with one Sobol sequence.

    `draw(seed, rays)` is an estimate of the wanted.
    """
    single = np.array([draw(seed, 1) for seed in range(MOST)]) - wanted
    independent = [rms(single.reshape(-1, n, *single.shape[1:]).mean(1)) for n in COUNTS]
    sobol = [rms(np.array([draw(seed, n) for seed in range(4)]) - wanted) for n in COUNTS]
    return slope(independent), slope(sobol)


def check(found: tuple[float, float]) -> None:
    independent, sobol = found
    assert independent == pytest.approx(-0.5, abs=0.05)
    assert sobol < -0.45  # stratified: steeper


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_changes_of_real_surfaces(device: ComputeDevice, estimator: Estimator) -> None:
    frame = furnace("plain")
    objects = [ball(*BALL, BLACK)]
    with kernels(device, frame, objects, estimator, aim_at=lamps(frame)) as run:
        wanted = -ball_factor(*run.receivers(), BALL[0], as_large(objects[0], BALL[1]))
        check(slopes(lambda seed, rays: run.change(seed, rays)[..., 0], wanted))


def test_irradiance(device: ComputeDevice) -> None:
    frame = furnace("sphere")
    with kernels(device, frame, [ball(*BALL, BLACK)], aim_at=lamps(frame)) as run:
        check(slopes(lambda seed, rays: run.irradiance(seed, rays)[:, 0], np.ones(1)))


@pytest.mark.parametrize("name", ["diffuse", "conductor"])
def test_virtual_surfaces(device: ComputeDevice, name: str) -> None:
    frame, material = furnace("sphere"), MATERIALS[name]
    kind = "diffuse" if name == "diffuse" else "specular"
    with kernels(device, frame, [box_of(material)], aim_at=lamps(frame), view=BOX_VIEW) as run:
        inside, wanted = box_truth(run, material)
        check(slopes(lambda seed, rays: run.reflected(seed, rays)[kind][inside, 0], wanted[kind]))
