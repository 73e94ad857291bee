"""Quality presets: the settings behind `--quality`."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

Quality = Literal["draft", "balanced", "accurate", "final"]

# Rays gain most. The finer map of E_R helps in the corners of rooms.
_ACCURATE: Mapping[str, object] = {
    "trace.rays": 8,
    "trace.object_rays": 64,
    "iprt.ratio_rows": 128,
    "irradiance.rows": 256,
    "irradiance.samples": 1024,
}

PRESETS: Mapping[Quality, Mapping[str, object]] = MappingProxyType(
    {
        # Light is computed for a sixteenth of the pixels; outlines and textures stay sharp. Three
        # levels of the filter reach as far across the picture as five at full resolution.
        "draft": {
            "light_scale": 4,
            "coverage_samples": 2,
            "iprt.ratio_rows": 32,
            "irradiance.rows": 64,
            "atrous.levels": 3,
        },
        # The defaults of `Settings`.
        "balanced": {},
        "accurate": _ACCURATE,
        # The remaining noise is that in E_R, which more frames do not reduce.
        "final": {**_ACCURATE, "irradiance.samples": 4096},
    }
)
"""Settings (see `iprt settings`) of each preset; all others keep their defaults."""

CONVERGED: Mapping[Quality, float] = MappingProxyType({"final": 0.001})
"""Noise (`iprt.convergence`) to which `iprt render` accumulates a still picture. Other presets have
a fixed number of frames."""

STILL: Mapping[str, object] = MappingProxyType({"fading": 0.0})
"""Settings of static pictures: the mean of all frames is the best picture."""
