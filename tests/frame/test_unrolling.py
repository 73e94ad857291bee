"""Loops over neighbouring pixels, unrolled for CPUs and rolled for GPUs: the same pictures."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from tests.films import films, play

pytestmark = pytest.mark.gl


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["remembered"])
def test_pictures_agree(device: ComputeDevice, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    film = films()[name]
    pictures = []
    for wide in (True, False):
        monkeypatch.setattr(ComputeDevice, "wide", property(lambda _, wide=wide: wide))
        pictures.append(play(device, film).color)
    np.testing.assert_allclose(pictures[0], pictures[1], rtol=1e-3, atol=1e-5)
