"""Ways to choose directions: each finds the same light, and aiming finds it with less noise."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t

from iprt.device import program
from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.files.resources import CL
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from tests.oracles.worlds import World
from tests.trace.estimators import ESTIMATORS, Estimator, kernels
from tests.worlds import Float, ball, ceiling_lamp, room_frame

pytestmark = pytest.mark.gl

ROOM = World()
DOWN = View(48, 36, pitch_deg=-35.0)
RED = Material(albedo=(0.9, 0.5, 0.1))
OBJECTS = [ball((0.2, ROOM.low[1] + 0.35, -1.4), 0.3, RED, subdivisions=5)]


@contextmanager
def shares(
    folder: Path, monkeypatch: pytest.MonkeyPatch, box: str, light: str
) -> Iterator[ComputeDevice]:
    """A device whose kernels choose directions in other proportions."""
    text = (CL / "trace/trace_delta.cl").read_text()
    text, replaced = re.subn(r"(#define BOX_SHARE(?:_INSIDE)?) .*", rf"\1 {box}", text)
    text, more = re.subn(r"0\.5f \* \(left - box_share\)", light, text)
    assert (replaced, more) == (2, 1)
    file = folder / "trace_delta.cl"
    file.write_text(text)
    with monkeypatch.context() as patched:
        patched.setattr(program, "CL", Instead(file))
        yield ComputeDevice(choose_device("pocl"))


class Instead:
    """`cl/` with another file in place of the one of its name; what others compile is the same."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def __truediv__(self, name: str) -> Path:
        return self._file if name == f"trace/{self._file.name}" else CL / name


def below_a_lamp() -> Frame:
    return room_frame(ROOM, 128, 64, ceiling_lamp)


def blocks(image: Float, side: int = 6) -> Float:
    """(N,) means over squares of pixels of (H, W)."""
    height, width = image.shape
    parts = image.reshape(height // side, side, width // side, side)
    return np.asarray(parts.mean((1, 3)).ravel())


def agree(samples: Float, wanted: Float, slack: Float) -> None:
    """Means of (runs, N) independent samples are the wanted (N,), by t-tests that together reject a
    right estimator once in 100 times; `slack` (N,) is what the wanted is unsure by.
    """
    runs, count = samples.shape
    # Blocks of like brightness are equally noisy: pooled, the deviations are surer.
    deviation = samples.std(0, ddof=1)
    pooled = np.sqrt((deviation**2).mean())
    error = np.maximum(deviation, 0.5 * pooled) / np.sqrt(runs)
    threshold = t.isf(0.5 * (1.0 - 0.99 ** (1.0 / count)), runs - 1)
    apart = np.abs(samples.mean(0) - wanted)
    assert (apart < threshold * error + slack).all(), (apart / (error + slack)).max()


def blocked_and_bounced(device: ComputeDevice) -> Float:
    """(runs, N, 2) irradiance / π of squares of pixels, in red."""
    with kernels(device, below_a_lamp(), OBJECTS, view=DOWN) as run:
        runs = [run.parts(seed, 32)[..., 0] for seed in range(6)]
    return np.array([np.stack([blocks(r[..., 0]), blocks(r[..., 1])], -1) for r in runs])


@pytest.fixture(scope="module")
def mixed(device: ComputeDevice) -> Float:
    """Return the estimates of the unmodified kernels."""
    return blocked_and_bounced(device)


@pytest.mark.parametrize(
    ("box", "light"),
    [("0.0f", "0.0f"), ("0.45f", "0.45f")],
    ids=["cosine", "boxes and lights"],
)
def test_each_way_to_choose_directions_finds_the_same(
    mixed: Float,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    box: str,
    light: str,
) -> None:
    with shares(tmp_path, monkeypatch, box, light) as other:
        alone = blocked_and_bounced(other)
    for part in (0, 1):
        a, b = mixed[..., part], alone[..., part]
        assert a.mean() > 0.01
        slack = 4.0 * a.std(0, ddof=1) / np.sqrt(len(a)) + 0.003 * a.max()
        agree(b, a.mean(0), slack)
        error = np.hypot(*(np.std(s.mean(1), ddof=1) / np.sqrt(len(s)) for s in (a, b)))
        assert abs(a.mean() - b.mean()) < 4.5 * error + 2e-3 * a.mean()


@pytest.mark.thorough
def test_less_than_a_third_of_the_variance_at_equal_rays(device: ComputeDevice) -> None:
    """The quotient varies so with 16 rays per pixel, below a lamp."""

    def variance(estimator: Estimator) -> float:
        with kernels(device, below_a_lamp(), OBJECTS, estimator, view=DOWN) as run:
            runs = [run.ratio(seed, 16) for seed in range(12)]
        return float(np.var(runs, axis=0, ddof=1).mean())

    aimed, even, ratio = (variance(estimator) for estimator in ESTIMATORS)
    print(f"variance: delta, aimed {aimed:.4f}; delta {even:.4f}; ratio {ratio:.4f}")
    assert aimed < 0.33 * ratio
    assert aimed < even
