"""Quality presets: what `--quality` sets."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

Quality = Literal["draft", "balanced", "accurate", "final"]

# Rays: nothing else gains as much. A finer map of E_R for the corners of rooms.
_ACCURATE: Mapping[str, object] = {
    "trace.rays": 8,
    "trace.object_rays": 64,
    "iprt.ratio_rows": 128,
    "irradiance.rows": 256,
    "irradiance.samples": 1024,
}

PRESETS: Mapping[Quality, Mapping[str, object]] = MappingProxyType(
    {
        # A sixteenth of the pixels have light; outlines and textures stay sharp. The filter reaches
        # as far across the picture as with all of them.
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
        # What is left at last is the noise of E_R, which more frames do not take away.
        "final": {**_ACCURATE, "irradiance.samples": 4096},
    }
)
"""Settings (see `iprt settings`) that a preset sets; all others keep their defaults."""

CONVERGED: Mapping[Quality, float] = MappingProxyType({"final": 0.001})
"""Noise (`iprt.convergence`) to which `iprt render` accumulates a still picture; of other presets
the number of frames is fixed."""

STILL: Mapping[str, object] = MappingProxyType({"fading": 0.0})
"""Settings of pictures in which nothing moves: the mean of all frames is the best picture."""
