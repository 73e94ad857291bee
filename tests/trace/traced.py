"""Frames whose truth is known at the centres of pixels, and where mirrors look in them."""

from __future__ import annotations

from typing import Any

import numpy as np

from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.settings.model import Settings
from tests.oracles.worlds import Sphere, World
from tests.variants import variant
from tests.worlds import Float

ROOM = World()
FLOOR = ROOM.low[1]
BLACK = Material(albedo=(0.0, 0.0, 0.0))
MIRROR = Material("conductor", (0.9, 0.8, 0.7), alpha=0.0)


def settings(
    rays: int = 1, relit: bool = False, estimator: str = "delta", **others: Any
) -> Settings:
    """Rays of objects start at the pixels' centres, which is where truth is known."""
    chosen = {
        "fading": 0.0, "trace": {"rays": rays, "jitter": False},
        "iprt": {"relight_reflections": relit},
    }  # fmt: skip
    return variant(estimator, **{**chosen, **others})


def mirror_rays(view: View, solid: Sphere) -> tuple[Float, Float, Float]:
    """Points on a ball seen through pixels, mirror directions there, cosines (0: beside it)."""
    d = view.directions()
    t, _, normal, _ = solid.interval(np.zeros(d.shape), d)
    seen = np.isfinite(t)
    point = np.where(seen, t, 1.0)[..., None] * d
    cosine = np.where(seen, -(normal * d).sum(-1), 0.0)
    return point, np.where(seen[..., None], d + 2.0 * cosine[..., None] * normal, d), cosine
