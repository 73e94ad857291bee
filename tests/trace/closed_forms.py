"""Light of balls, discs and boxes that has a closed form, in scenes where all else shines alike."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from tests.oracles.brdf import covered_albedo, diffuse_albedo, specular_albedo
from tests.trace.estimators import Kernels, confirm
from tests.worlds import Float, cuboid

RUNS = 64
BALL, DISC = ((0.2, -0.8, -0.9), 0.45), ((0.2, -0.8, -0.9), 0.5)
LAMP = Material(albedo=(0.0, 0.5, 1.0))
"""Black in red; in blue, in a furnace, as bright as what it hides."""
BLACK = Material(albedo=(0.0, 0.0, 0.0))


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


def confirm_ball(run: Kernels, shining: Instance, rays: int, rounding: float = 1e-4) -> None:
    """Require that the ball `BALL` of `LAMP` hides its form factor, and sends its albedo's part."""
    factor = ball_factor(*run.receivers(), BALL[0], as_large(shining, BALL[1]))
    parts = np.array([run.parts(seed, rays) for seed in range(RUNS)])
    confirm(parts[..., 0, 0].reshape(RUNS, -1), factor.ravel(), rounding=rounding)
    for channel, albedo in enumerate(LAMP.albedo):
        sent = parts[..., 1, channel].reshape(RUNS, -1)
        if albedo > 0.0:
            confirm(sent, albedo * factor.ravel(), rounding=rounding)
        else:
            np.testing.assert_array_equal(sent, 0.0)


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
    if material.is_covered:
        layers = [covered_albedo(material, o) for o in outgoing]
        specular = np.array([sum(one.values())[0] - one["diffuse"][0] for one in layers])
    elif material.kind != "diffuse":
        specular = np.array([specular_albedo(material, o, nodes=120)[0] for o in outgoing])
    return inside, {
        "diffuse": np.interp(cosine, nodes, diffuse),
        "specular": np.interp(cosine, nodes, specular),
    }
