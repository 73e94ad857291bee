"""Meshes without normals look to Mitsuba as they do to the renderer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance
from iprt.geometry.meshes import load_mesh
from tests.geometry.test_creases import exported

pytestmark = pytest.mark.mitsuba

ORIGIN = np.array([0.0, 0.0, -3.0])
VIEW = View(64, 64, fov_y_deg=40.0)


def shading_normals(mi: Any, path: Path) -> Any:
    """(H, W, 3) of a mesh that is turned and placed ahead; 0 where it is not seen."""
    from iprt.truth.sensor import sensor
    from iprt.truth.shapes import instance_shapes

    to_world = trimesh.transformations.rotation_matrix(0.6, [1.0, 2.0, 0.5])
    to_world[:3, 3] = ORIGIN
    shapes = instance_shapes([Instance("it", load_mesh(path), to_world)])
    scene = mi.load_dict({"type": "scene", **shapes})
    layers = mi.load_dict({"type": "aov", "aovs": "n:sh_normal,g:geo_normal"})
    camera = sensor(VIEW, pixel_centres=True)
    return np.array(mi.render(scene, sensor=camera, integrator=layers, spp=1))[..., -6:]


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".glb"])
def test_boxes_are_flat(mi: Any, suffix: str, tmp_path: Path) -> None:
    seen = shading_normals(mi, exported(trimesh.creation.box(), tmp_path / f"b{suffix}"))
    there = seen[..., 3:].any(axis=-1)
    assert there.mean() > 0.1
    np.testing.assert_allclose(seen[there, :3], seen[there, 3:], atol=1e-5)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl"])
def test_spheres_are_round(mi: Any, suffix: str, tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.7)
    seen = shading_normals(mi, exported(ball, tmp_path / f"b{suffix}"))
    there = seen[..., 3:].any(axis=-1)
    directions = VIEW.directions()[there]
    along = directions @ ORIGIN
    reach = np.maximum(along**2 - ORIGIN @ ORIGIN + 0.49, 0.0)
    inner = reach > 0.05
    hit = directions * (along - np.sqrt(reach))[:, None] - ORIGIN
    cosine = np.einsum("pi,pi->p", seen[there, :3], hit) / 0.7
    # Facets lie up to 2% inside of the sphere that the directions are of; flat ones are off by 10.
    assert cosine[inner].min() > np.cos(np.deg2rad(4.0))
