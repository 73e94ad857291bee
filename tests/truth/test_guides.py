"""What guides the denoiser of path-traced truth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from iprt.geometry.camera import View

pytestmark = pytest.mark.mitsuba

WALL = (0.2, 0.5, 0.7)
Place = tuple[tuple[int, int, int], tuple[int, int, int]]
"""A point, and where the surface there faces."""
PATHS: list[list[Place]] = [
    [((0, 0, -2), (0, 0, 1))],
    [((0, 0, -2), (1, 0, 1)), ((2, 0, -2), (-1, 0, 0))],
    # To -z, at the first mirror to +x, at the second to -z again.
    [((0, 0, -2), (1, 0, 1)), ((2, 0, -2), (-1, 0, -1)), ((2, 0, -4), (0, 0, 1))],
]


@pytest.mark.parametrize("path", PATHS, ids=["wall", "mirror", "two mirrors"])
def test_guides_are_of_what_mirrors_show(mi: Any, path: list[Place]) -> None:
    from iprt.truth.model import load_scene, render_guides

    mirror = {"type": "conductor", "material": "none"}
    wall = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(WALL)}}
    bsdfs = [mirror] * (len(path) - 1) + [wall]
    parts = {
        f"part{number}": {
            "type": "disk",
            "bsdf": bsdf,
            "to_world": mi.ScalarTransform4f().look_at(
                origin=list(at), target=list(np.add(at, facing)), up=[0, 1, 0]
            ),
        }
        for number, ((at, facing), bsdf) in enumerate(zip(path, bsdfs, strict=True))
    }
    albedo, normal = render_guides(load_scene(parts), View(5, 5, 0, 0, 4), spp=4, seed=0)
    np.testing.assert_allclose(albedo, np.broadcast_to(WALL, albedo.shape), atol=1e-3)
    np.testing.assert_allclose(normal, np.broadcast_to(path[-1][1], normal.shape), atol=1e-3)


def test_guides_pass_glass(mi: Any) -> None:
    """The wall behind a clear ball guides, which a ray through its middle meets."""
    from iprt.truth.model import load_scene, render_guides

    wall = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(WALL)}}
    to_world = mi.ScalarTransform4f().translate([0, 0, -8]).scale(20)
    parts = {
        "ball": {"type": "sphere", "center": [0, 0, -3], "bsdf": {"type": "dielectric"}},
        "wall": {"type": "rectangle", "to_world": to_world, "bsdf": wall},
    }
    albedo, normal = render_guides(load_scene(parts), View(5, 5, 0, 0, 4), spp=4, seed=0)
    np.testing.assert_allclose(albedo, np.broadcast_to(WALL, albedo.shape), atol=1e-3)
    np.testing.assert_allclose(normal, np.broadcast_to((0, 0, 1), normal.shape), atol=1e-3)
