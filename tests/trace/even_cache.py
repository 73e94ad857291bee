"""A world that is lit evenly."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from iprt.device.compute import ComputeDevice
from iprt.world.real.irradiance import BLACK, SURFACES, IrradianceCacheArgs
from iprt.world.real.sun import SunArgs

MEAN_RADIANCE = 2.0
WORLD: Any = SimpleNamespace(panorama=SimpleNamespace(mean_radiance=MEAN_RADIANCE, sun=SunArgs()))


class EvenCache:
    """Knows the same E_R / π everywhere."""

    def __init__(self, device: ComputeDevice, irradiance: np.ndarray) -> None:
        entries = SURFACES * 16 * 32
        cells = np.zeros((2 * entries, 4), np.float32)
        cells[:entries] = (*irradiance, 1.0)
        self._plane = device.upload("plane", np.zeros((entries, 4), np.float32))
        self._irradiance = device.upload("irradiance", cells)

    def arguments(self, panorama: Any) -> IrradianceCacheArgs:
        return IrradianceCacheArgs(
            plane=self._plane,
            irradiance=self._irradiance,
            columns=32,
            rows=16,
            black=float(BLACK * panorama.mean_radiance),
        )
