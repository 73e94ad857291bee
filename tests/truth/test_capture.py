"""A sequence of our room by Mitsuba, with a sensor's faults, against the panorama at its centre."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from iprt.capture.scene import MEASURED, capture_panorama
from iprt.capture.sequence import RgbdSequence
from iprt.geometry.camera import View
from iprt.measure.metrics import psnr
from iprt.output.display import srgb_encode
from iprt.truth.denoise import denoise
from iprt.truth.model import load_parts, load_scene
from tests.capture.rendered import distances, traced
from tests.capture.sequences import Array, Camera, looking_around, noisy, write_tum

pytestmark = [pytest.mark.mitsuba, pytest.mark.slow]


def clean(color: Array) -> Array:
    """Without the noise of paths, which is far above a camera's."""
    flat = np.full(color.shape, 0.5, np.float32)
    cleaned = denoise(color.astype(np.float32), flat, np.zeros_like(flat), wrap=False)
    return np.maximum(cleaned, 0.0).astype(np.float64)


def test_the_room_is_found_again(mi: Any, tmp_path: Path) -> None:
    """Noise, missing depth, 8 bits, drifting exposure: PSNR of what was seen, and its depth."""
    scene = load_scene(load_parts("scenes360.room.model"))
    random = np.random.default_rng(1)
    poses = [*looking_around(14, (0.0, 45.0, -45.0)), *looking_around(4, (80.0, -80.0))]

    def shoot(number: int, origin: Array, rays: Array) -> tuple[Array, Array]:
        gain = 1.0 + 0.3 * np.sin(0.5 * number)
        color = gain * clean(traced(mi, scene, origin, rays, 32, number))
        return color, noisy(distances(mi, scene, origin, rays), random)

    folder = write_tum(tmp_path / "s", Camera(80, 60, 55.0), poses, shoot)
    result = capture_panorama(RgbdSequence.open(folder), width=128, center=np.zeros(3))
    directions = View(128, 64, projection="equirect").directions()
    depth = distances(mi, scene, np.zeros(3), directions)
    color = clean(traced(mi, scene, np.zeros(3), directions, 256, 999))
    measured = (result.seen == MEASURED) & (depth > 0.0)
    assert measured.mean() > 0.9
    assert result.left_out <= 2
    assert np.median(np.abs(result.depth - depth)[measured]) < 0.01
    assert np.quantile(np.abs(result.depth[measured] / depth[measured] - 1.0), 0.9) < 0.05
    shown, true = (
        srgb_encode(np.clip(picture, 0.0, 1.0))[measured][None].astype(float)
        for picture in (result.color, color)
    )
    assert psnr(shown, true) > 24.0
