"""What objects change in the light of real surfaces, as `iprt` finds it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import t

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import Renderer
from tests.oracles.worlds import Box, Solid, Sphere, World
from tests.variants import variant
from tests.worlds import Float, ball, cuboid

ROOM = World()
FLOOR = ROOM.low[1]
DOWN = View(48, 36, pitch_deg=-35.0)
BLACK = Material(albedo=(0.0, 0.0, 0.0))
RED = Material(albedo=(0.9, 0.5, 0.1))
PLATE = Box((0.2, FLOOR + 0.5, -1.3), (0.5, 0.02, 0.35))
BALL = Sphere((0.2, FLOOR + 0.35, -1.4), 0.3)
SCENES: dict[str, tuple[Solid, list[Instance], Material]] = {
    "plate": (PLATE, [cuboid(PLATE.centre, PLATE.half, BLACK)], BLACK),
    "ball": (BALL, [ball(BALL.centre, BALL.radius, RED, subdivisions=5)], RED),
}
STILL = {"rows": 16, "rays": 32, "samples": 64}
"""E_R is the same in all frames, so that the signal times E_R is irradiance, whatever E_R is."""
SURE = {"rows": 16, "rays": 512, "samples": 1024}
"""E_R is well known at once."""


def change_of(
    device: ComputeDevice,
    frame: Frame,
    objects: Sequence[Instance],
    view: View,
    *,
    frames: int = 4,
    seed: int = 0,
    filtered: bool = False,
    irradiance: dict[str, int] | None = None,
    estimator: str = "delta",
    **trace: Any,
) -> tuple[Float, Float, Float, Float]:
    """(H, W, 3) blocked and bounce over E_R, E_R / π, ratio."""
    chosen: dict[str, Any] = {
        "seed": seed,
        "fading": 0.0,
        "irradiance": irradiance or {},
        "iprt": {"relight_reflections": False},
        "trace": trace,
    }
    if not filtered:
        chosen |= {"atrous": {"levels": 0}, "mask": {"sparse": False}}
    with Renderer(device, frame, objects, view, variant(estimator, **chosen)) as renderer:
        aovs = renderer.render(frames, ("irradiance_real", "ratio")).aovs
        planes = renderer.layout.interior(device.read(renderer.method.real_pixels.change))
    change = np.moveaxis(planes.astype(np.float64), 0, -1)
    return (
        change[..., :3], change[..., 3:6],
        aovs["irradiance_real"].astype(np.float64), aovs["ratio"].astype(np.float64),
    )  # fmt: skip


def blocks(image: Float, side: int = 6) -> Float:
    """(N,) means over squares of pixels of (H, W)."""
    h, w = (n // side * side for n in image.shape)
    parts = image[:h, :w].reshape(h // side, side, w // side, side)
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


def absolute(
    device: ComputeDevice, frame: Frame, objects: list[Instance], runs: int, **others: Any
) -> Float:
    """(runs, N, 2, 3) blocked and bounced irradiance / π of squares of pixels."""
    found = []
    for seed in range(runs):
        blocked, bounce, real, _ = change_of(
            device, frame, objects, DOWN, seed=seed, irradiance=STILL, **others
        )
        found.append(
            [[blocks(part[..., c] * real[..., c]) for c in range(3)] for part in (blocked, bounce)]
        )
    return np.moveaxis(np.array(found), -1, 1)
