"""Means of the tracing kernels' estimates are closed forms, pixel by pixel and all together.

Every case draws a million samples or more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from tests.oracles.brdf import diffuse_albedo, specular_albedo
from tests.trace.estimators import (
    ESTIMATORS,
    PLAIN,
    Around,
    Estimator,
    Kernels,
    confirm,
    furnace,
    kernels,
    lamps,
)
from tests.worlds import Float, ball, cuboid, disc

pytestmark = pytest.mark.thorough

RUNS, RAYS = 64, 32
BALL, DISC = ((0.2, -0.8, -0.9), 0.45), ((0.2, -0.8, -0.9), 0.5)
LAMP = Material(albedo=(0.0, 0.5, 1.0))
"""Black in red; in blue, in a furnace, as bright as what it hides."""
BLACK = Material(albedo=(0.0, 0.0, 0.0))
WAYS: tuple[Estimator, ...] = ("delta, aimed", "delta, even")


def ball_factor(points: Float, normals: Float, centre: Sequence[float], radius: float) -> Float:
    """Form factor of a ball above the horizon: (r / d)² cos β, with d and β of its centre.

    It is also the irradiance / π of a spherical light of radiance 1.
    """
    away = np.asarray(centre) - points
    distance = np.linalg.norm(away, axis=-1)
    return np.asarray((radius / distance) ** 2 * (away * normals).sum(-1) / distance)


def disc_factor(points: Float, centre: Sequence[float], radius: float) -> Float:
    """Form factor of a disc parallel to the surface (J. Howell, *A Catalog of Radiation Heat
    Transfer Configuration Factors*, B-13).
    """
    away = np.asarray(centre) - points
    a = np.hypot(away[..., 0], away[..., 2])
    h, r = away[..., 1] / a, radius / a
    z = 1.0 + h * h + r * r
    return np.asarray(0.5 * (1.0 - (z - 2.0 * r * r) / np.sqrt(z * z - 4.0 * r * r)))


def as_large(instance: Instance, radius: float) -> float:
    """Radius of the ball whose mean shadow is the mesh's: a convex body's is a quarter of its
    surface (Cauchy).
    """
    corners = instance.mesh.positions[instance.mesh.triangles].astype(np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return radius * float(np.sqrt(0.5 * np.linalg.norm(cross, axis=1).sum() / (4.0 * np.pi)))


# Real surfaces -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("estimator", "around"),
    [*((estimator, "plain") for estimator in ESTIMATORS), ("delta, aimed", "sphere")],
)
def test_a_ball_hides_light_and_shines(
    device: ComputeDevice, estimator: Estimator, around: Around
) -> None:
    """A spherical light above a plane: irradiance π L (r / d)² cos β, less what it hides."""
    frame = furnace(around)
    objects = [ball(*BALL, LAMP)]
    with kernels(device, frame, objects, estimator, aim_at=lamps(frame)) as run:
        factor = ball_factor(*run.receivers(), BALL[0], as_large(objects[0], BALL[1]))
        if estimator == "ratio":
            change = np.array([run.change(seed, RAYS) for seed in range(RUNS)])
        else:
            parts = np.array([run.parts(seed, RAYS) for seed in range(RUNS)])
            confirm(parts[..., 0, 0].reshape(RUNS, -1), factor.ravel())
            change = parts[..., 1, :] - parts[..., 0, :]
    for channel in (0, 1):
        wanted = (LAMP.albedo[channel] - 1.0) * factor
        confirm(change[..., channel].reshape(RUNS, -1), wanted.ravel())
    if estimator == "ratio":  # the same rays for both: what shines as bright hides nothing
        np.testing.assert_allclose(change[..., 2], 0.0, atol=1e-5)
    else:
        confirm(parts[..., 1, 2].reshape(RUNS, -1), factor.ravel())


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_disc_hides_its_form_factor(device: ComputeDevice, estimator: Estimator) -> None:
    frame = furnace("plain")
    with kernels(device, frame, [disc(*DISC, BLACK)], estimator, aim_at=lamps(frame)) as run:
        wanted = disc_factor(run.receivers()[0], *DISC)
        change = np.array([run.change(seed, RAYS)[..., 0] for seed in range(RUNS)])
    confirm(change.reshape(RUNS, -1), -wanted.ravel())


def test_no_light_leaks_into_a_box_that_stands_on_the_plain(device: ComputeDevice) -> None:
    """Its lower face lies in the plain. Of paths inside only the last ray, which meets no objects
    any more (Algorithm 1, lines 4-6), finds light.
    """
    albedo, bounces = 0.5, 4
    half = np.array([0.4, 0.2, 0.3])
    to_world = np.eye(4)
    to_world[:3, :3] = View(1, 1, yaw_deg=25.0).world_from_view
    to_world[:3, 3] = (0.3, PLAIN + half[1], -1.1)
    box = replace(cuboid((0, 0, 0), half, Material(albedo=(albedo,) * 3)), to_world=to_world)
    frame = furnace("plain")
    with kernels(device, frame, [box], "delta, even") as run:
        local = (run.receivers()[0] - to_world[:3, 3]) @ to_world[:3, :3]
        inside = (np.abs(local) < half - 0.02).all(-1, where=[True, False, True])
        parts = run.parts(1, RAYS)[inside]
    assert inside.sum() > 30
    np.testing.assert_allclose(parts[:, 0], 1.0, rtol=1e-4)
    np.testing.assert_allclose(parts[:, 1], albedo**bounces, rtol=1e-4)


# Virtual surfaces ----------------------------------------------------------------------------


BOX_VIEW = View(40, 30, pitch_deg=-38.0, fov_y_deg=60.0)
MATERIALS = {
    "diffuse": Material(albedo=(0.8, 0.5, 0.2)),
    "conductor": Material("conductor", (0.9, 0.6, 0.3), alpha=0.3),
    "plastic": Material("plastic", (0.8, 0.5, 0.2), alpha=0.2),
}


def box_of(material: Material) -> Instance:
    """`BOX_VIEW` shows its top and front, which are flat: no ray meets it again."""
    return cuboid((0.1, -0.75, -1.0), (0.5, 0.2, 0.4), material)


def box_truth(run: Kernels, material: Material) -> tuple[NDArray[np.bool_], dict[str, Float]]:
    """(H, W) pixels of the box, and (N,) what each lobe reflects there in a furnace, in red:
    its albedo by the viewing angle, by quadrature of the BRDF.
    """
    visible = run.renderer.visible
    normal, inside = (
        np.moveaxis(run.renderer.layout.interior(run.device.read(planes)), 0, -1)
        for planes in (visible.normal, visible.id)
    )
    inside = inside[..., 0] > 0.0
    cosine = -(normal.astype(np.float64) * BOX_VIEW.directions()).sum(-1)[inside]
    nodes = np.linspace(cosine.min(), cosine.max(), 24)
    outgoing = [np.array([np.sqrt(1.0 - c * c), 0.0, c]) for c in nodes]
    diffuse = [diffuse_albedo(material, o) for o in outgoing]
    specular = np.zeros(24)
    if material.kind != "diffuse":
        specular = np.array([specular_albedo(material, o, nodes=120)[0] for o in outgoing])
    return inside, {
        "diffuse": np.interp(cosine, nodes, diffuse),
        "specular": np.interp(cosine, nodes, specular),
    }


@pytest.mark.parametrize(
    ("name", "estimator"), [*((name, WAYS[0]) for name in MATERIALS), ("diffuse", WAYS[1])]
)
def test_virtual_surfaces_reflect_their_albedo(
    device: ComputeDevice, name: str, estimator: Estimator
) -> None:
    """In a furnace, whatever lights are aimed at; each lobe apart."""
    material = MATERIALS[name]
    frame, objects = furnace("sphere"), [box_of(material)]
    with kernels(device, frame, objects, estimator, aim_at=lamps(frame), view=BOX_VIEW) as run:
        runs = [run.reflected(seed, RAYS) for seed in range(RUNS)]
        inside, wanted = box_truth(run, material)
    assert inside.sum() * RUNS * RAYS > 1e6
    for kind in runs[0]:
        found = np.array([one[kind][inside, 0] for one in runs])
        confirm(found, wanted[kind], rounding=5e-4)
