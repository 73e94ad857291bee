"""Quality presets: what `--quality` sets, in one table."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

Quality = Literal["draft", "balanced", "accurate"]

PRESETS: Mapping[Quality, Mapping[str, object]] = MappingProxyType(
    {
        # A quick look: the penumbra of reflections of reflections is not worth its rays.
        "draft": {"trace.bounces": 2, "mask.low": 0.5, "mask.high": 0.8, "atrous.levels": 4},
        # The defaults of `Settings`.
        "balanced": {},
        # For stills and for reference: rays where the mask would spare them.
        "accurate": {"trace.rays": 4, "mask.low": 0.15, "mask.high": 0.3},
    }
)
"""Knobs (see `iprt settings`) that a preset sets; all others keep their defaults."""

STILL: Mapping[str, object] = MappingProxyType({"fading": 0.0})
"""Knobs of pictures in which nothing moves: the mean of all frames is the best picture."""
