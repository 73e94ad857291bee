"""Emitting triangles: places, shares and power."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.bvh.scene import SceneBuilder
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance, transformed
from iprt.world.objects.lamps import emitters_of
from tests.meshes import sphere, transform

DARK = Material()
GLOW = Material(emission=(3.0, 6.0, 0.0))
BRIGHT = Material(
    emission=(10.0, 10.0, 10.0), emission_texture=np.full((2, 2, 3), 0.25, np.float32)
)


def halves(*materials: Material) -> Instance:
    """A stretched, mirrored ball whose triangles have two materials in turn."""
    mesh = sphere(1, materials)
    index = np.arange(len(mesh.triangles), dtype=np.int32) % len(materials)
    linear = np.diag([-0.2, 0.5, 3.0])
    return Instance("ball", replace(mesh, material_index=index), transform(linear, (1, 2, 3)))


def areas(instance: Instance) -> np.ndarray:
    corners = transformed(instance.to_world, instance.mesh.positions)[instance.mesh.triangles]
    sides = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(0.5 * np.linalg.norm(np.cross(*sides), axis=1))


def test_power_is_area_times_mean_emission() -> None:
    instances = [halves(DARK), halves(DARK, GLOW), halves(BRIGHT, GLOW)]
    scene = SceneBuilder().build(instances)
    found = emitters_of(scene, instances)
    expected = []
    for row, place in found.places:
        instance = instances[scene.instance_of[row]]
        triangle = scene.slots[place]
        material = instance.mesh.materials[instance.mesh.material_index[triangle]]
        mean = {DARK: 0.0, GLOW: 3.0, BRIGHT: 2.5}[material]
        assert mean > 0.0
        expected.append(mean * areas(instance)[triangle])
    assert len(found.places) == 1.5 * len(instances[0].mesh.triangles)
    assert len(np.unique(found.places, axis=0)) == len(found.places)
    assert found.power == pytest.approx(sum(expected), rel=1e-5)
    np.testing.assert_allclose(
        np.diff(found.share, prepend=0.0), np.array(expected) / found.power, atol=1e-6
    )
    assert found.share[-1] == pytest.approx(1.0)


def test_without_lamps_there_is_no_power() -> None:
    instances = [halves(DARK)]
    found = emitters_of(SceneBuilder().build(instances), instances)
    assert len(found.places) == len(found.share) == found.power == 0
