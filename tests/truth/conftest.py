"""Fixtures of the tests that compare with Mitsuba."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.footage.frame import Frame
from iprt.geometry.camera import View


@pytest.fixture(scope="session")
def mi() -> Any:
    """Mitsuba's vectorized variant; skips where it is not installed or does not run."""
    pytest.importorskip("mitsuba", reason="needs the `reference` extra")
    from iprt.errors import DeviceError
    from iprt.truth.backend import vector_mitsuba

    try:
        return vector_mitsuba()
    except DeviceError as error:
        pytest.skip(str(error))


def sphere_frame(color: NDArray[np.float32], radius: float) -> Frame:
    """A panorama from inside a sphere."""
    height, width = color.shape[:2]
    directions = View(width, height, projection="equirect").directions()
    return Frame(
        color.astype(np.float32),
        np.full((height, width), radius, np.float32),
        np.zeros((height, width), bool),
        (-directions).astype(np.float32),
    )
