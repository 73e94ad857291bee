"""What is measured of learning: voxels against their definition, and a room's panorama."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.measure.learned_accuracy import TABLE_BYTES, VOXEL_BYTES, learn_frame, voxel_means
from iprt.settings.trace import LearningSettings
from tests.oracles.worlds import World
from tests.world.real.test_radiance_models import samples
from tests.worlds import bright_walls, room_frame


def test_voxels_hold_the_means_of_their_samples() -> None:
    """Eight voxels in a cube, of which samples lie in three."""
    points = np.array([[0.0, 0, 0], [0.1, 0.1, 0.2], [1.0, 1.0, 1.0], [0.99, 0.1, 0.1]])
    colors = np.array([[1.0, 2, 3], [3.0, 2, 1], [5.0, 5, 5], [7.0, 7, 7]])
    normals = np.broadcast_to([0.0, 1.0, 0.0], points.shape)
    made = samples(points, normals, colors)
    asked = samples(
        np.array([[0.2, 0.2, 0.2], [0.99, 0.99, 0.99], [0.2, 0.99, 0.2]]), normals[:3], colors[:3]
    )
    found = voxel_means(made, asked, 8 * VOXEL_BYTES, dense=True)
    np.testing.assert_allclose(found, [[2.0, 2.0, 2.0], [5.0, 5.0, 5.0], [0.0, 0.0, 0.0]])
    stored = 3 * (VOXEL_BYTES + TABLE_BYTES)
    np.testing.assert_array_equal(found, voxel_means(made, asked, stored, dense=False))


@pytest.mark.thorough
def test_a_room_is_learned(device: ComputeDevice) -> None:
    """Of even walls with waves, with less error than by voxels; memory grows and flattens."""
    frame = room_frame(World(), 256, 128, bright_walls)
    own = LearningSettings(samples=4096, models=8192)
    found = learn_frame(device, frame, own, 6, 0.5)
    assert found.error < 0.5 * found.dense_error
    assert found.known > 0.9
    assert found.ms > 0.0
    assert list(found.megabytes) == sorted(found.megabytes)
    grown = np.diff(found.megabytes)
    assert grown[-1] < 0.2 * found.megabytes[0]
    assert found.error == pytest.approx(learn_frame(device, frame, own, 6, 0.5).error)
