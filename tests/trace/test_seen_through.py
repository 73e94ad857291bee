"""Rays behind dielectrics against Snell's law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.geometry.solids import swollen
from iprt.trace.seen_through import SeenThrough
from iprt.trace.tracer_arguments import SurfacesArgs
from tests.oracles.brdf import fresnel
from tests.trace.closed_forms import BOX_VIEW as VIEW
from tests.trace.estimators import furnace, kernels
from tests.worlds import Float, cuboid

pytestmark = pytest.mark.thorough

IOR = 1.5
CLEAR = Material("dielectric", (1.0, 1.0, 1.0), alpha=0.0, ior=IOR)
WATER = replace(CLEAR, ior=1.33)
CENTRE, HALF = (0.1, -0.8, -0.9), (0.5, 0.1, 0.4)
TOP, BOTTOM = CENTRE[1] + HALF[1], CENTRE[1] - HALF[1]


def seen(device: ComputeDevice, objects: Sequence[Instance]) -> Float:
    """(10, H, W) rays beyond the objects."""
    with kernels(device, furnace("sphere"), list(objects), view=VIEW) as run:
        renderer = run.renderer
        shown = renderer.visible
        guide = renderer.method.reflecting_pixels.mask.guide
        through = SeenThrough(device, guide, renderer.features)
        surfaces = SurfacesArgs(
            albedo=shown.albedo, metallic=shown.metallic, roughness=shown.roughness
        )
        through.run(renderer.world, surfaces, run.view, 0)
        return np.asarray(guide.layout.interior(device.read(through.current)), np.float64)


def on_top(rays: Float) -> Float:
    """Pixels whose ray enters the slab by its top and leaves it by its bottom."""
    d = np.moveaxis(VIEW.directions(), -1, 0)
    point = d * (TOP / d[1])
    bent = d / IOR
    bent[1] = -np.sqrt(1.0 - bent[0] ** 2 - bent[2] ** 2)
    leaves = point + bent * ((BOTTOM - TOP) / bent[1])
    inside = np.ones(d.shape[1:], bool)
    for at in (point, leaves):
        for axis in (0, 2):
            inside &= np.abs(at[axis] - CENTRE[axis]) < HALF[axis] - 0.02
    return np.concatenate([leaves, d, inside[None]])


def test_rays_leave_a_slab_parallel_and_beside(device: ComputeDevice) -> None:
    rays = seen(device, [cuboid(CENTRE, HALF, CLEAR)])
    expected = on_top(rays)
    inside = expected[6] > 0.0
    assert inside.sum() > 100
    np.testing.assert_allclose(rays[3:6, inside], expected[3:6, inside], atol=1e-4)
    np.testing.assert_allclose(rays[:3, inside], expected[:3, inside], atol=2e-3)
    assert (rays[6, inside] > 0.0).all()
    # In a furnace of radiance 1, the first surface reflects Fresnel's share, and the rest passes.
    reflected = fresnel(-expected[4, inside], IOR)
    np.testing.assert_allclose(rays[8, inside], reflected, rtol=2e-3)
    np.testing.assert_allclose(rays[7, inside], 1.0 - reflected, rtol=2e-3)


def test_touching_solids_refract_in_turn(device: ComputeDevice) -> None:
    """Glass upon water, whose faces coincide: a ray has Snell's direction in either."""
    middle, half = 0.5 * (TOP + BOTTOM), (HALF[0], 0.5 * HALF[1], HALF[2])
    pair = [
        cuboid((CENTRE[0], middle + side * half[1], CENTRE[2]), half, material)
        for side, material in ((1.0, CLEAR), (-1.0, WATER))
    ]
    rays = seen(device, [replace(one, mesh=swollen(one.mesh)) for one in pair])
    d = np.moveaxis(VIEW.directions(), -1, 0)
    at = d * (TOP / d[1])
    inside = on_top(rays)[6] > 0.0
    for ior, bottom in ((IOR, middle), (1.33, BOTTOM)):
        bent = d / ior
        bent[1] = -np.sqrt(1.0 - bent[0] ** 2 - bent[2] ** 2)
        at = at + bent * ((bottom - at[1]) / bent[1])
        inside &= (np.abs(at[0] - CENTRE[0]) < 0.47) & (np.abs(at[2] - CENTRE[2]) < 0.37)
    assert inside.sum() > 100
    np.testing.assert_allclose(rays[3:6, inside], d[:, inside], atol=1e-4)
    np.testing.assert_allclose(rays[:3, inside], at[:, inside], atol=2e-3)
    alone = on_top(rays)[:3]
    assert np.linalg.norm(alone - at, axis=0)[inside].max() > 0.01


def test_objects_behind_glass_are_told_from_real_surfaces(device: ComputeDevice) -> None:
    board = cuboid((0.1, -1.0, -0.9), (0.7, 0.03, 0.5), Material(albedo=(0.5, 0.5, 0.5)))
    rays = seen(device, [cuboid(CENTRE, HALF, CLEAR), board])
    expected = on_top(rays)
    inside = expected[6] > 0.0
    distance = (expected[1] + 0.97) / -expected[4]
    np.testing.assert_allclose(rays[6, inside], -distance[inside], atol=2e-3)
