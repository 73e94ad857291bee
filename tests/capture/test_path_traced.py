"""A sequence path-traced in our own room, noisy and with holes, against its panorama."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from iprt.capture.scene import MEASURED, capture_panorama
from iprt.capture.sequence import RgbdSequence
from iprt.geometry.camera import View
from iprt.truth.denoise import denoise
from iprt.truth.model import load_parts, load_scene
from tests.capture.rendered import distances, traced
from tests.capture.sequences import Array, Camera, looking_around, noisy, write_tum

pytestmark = pytest.mark.mitsuba

WIDTH = 96
CAMERA = Camera(96, 72, 54.0)
POSES = [*looking_around(10, (0.0, 40.0, -40.0)), *looking_around(3, (80.0, -80.0))]
BLACK, WHITE = 0.0, 1.0
DRIFT = 0.2
"""Exposure goes up and down by so much, as automatic exposure does."""


@pytest.fixture(scope="module")
def mi() -> Any:
    pytest.importorskip("mitsuba", reason="needs the `reference` extra")
    from iprt.truth.backend import vector_mitsuba

    return vector_mitsuba()


def clean(color: Array) -> Array:
    """Without the noise of path tracing, which a camera does not have."""
    pytest.importorskip("pyoidn", reason="needs the `reference` extra")
    image = color.astype(np.float32)
    grey, ahead = np.full_like(image, 0.5), np.zeros_like(image) + np.float32([0.0, 0.0, 1.0])
    return denoise(image, grey, ahead, wrap=False).astype(np.float64)


@pytest.mark.thorough
def test_our_room_is_captured(mi: Any, tmp_path: Path) -> None:
    scene = load_scene(load_parts("scenes360.room.model"))
    random = np.random.default_rng(3)

    def shoot(number: int, origin: Array, rays: Array) -> tuple[Array, Array]:
        color = clean(traced(mi, scene, origin, rays, 24, number))
        exposure = 0.5 * (1.0 + DRIFT * np.sin(number / 3.0))
        return exposure * color, noisy(distances(mi, scene, origin, rays), random)

    sequence = RgbdSequence.open(write_tum(tmp_path / "s", CAMERA, POSES, shoot))
    result = capture_panorama(sequence, width=WIDTH, center=np.zeros(3))
    directions = View(WIDTH, WIDTH // 2, projection="equirect").directions()
    color = 0.5 * clean(traced(mi, scene, np.zeros(3), directions, 64, 99))
    depth = distances(mi, scene, np.zeros(3), directions)
    measured = (result.seen == MEASURED) & (depth > 0.0)
    assert measured.mean() > 0.9
    assert result.left_out <= 2
    off = np.abs(result.depth - depth)[measured] / depth[measured]
    assert np.median(off) < 0.01
    assert np.quantile(off, 0.8) < 0.05  # edges of things, which pixels of the camera mix
    shown, truth = (np.clip(c, BLACK, WHITE) for c in (result.color, color))
    error = np.abs(shown - truth).mean(axis=-1)[measured]
    assert np.median(error) < 0.02
    # All in the exposure of the first frame, which went up and down by DRIFT.
    lit = measured & (truth.min(axis=-1) > 0.02) & (truth.max(axis=-1) < 0.9)
    quotient = np.median(shown[lit] / truth[lit])
    assert abs(quotient - 1.0) < 0.1
