"""Clear coats above bumps: what they mirror in a room, themselves and seen in a mirror."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.light import Light
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from tests.oracles import brdf as oracle
from tests.raster.shapes import placed, quad
from tests.trace.estimators import Estimator, furnace, kernels, lamps
from tests.trace.test_trace_reflections import wall_light
from tests.trace.traced import MIRROR, ROOM
from tests.trace.virtual_lights import lit_by
from tests.worlds import Float, bright_walls, room_frame

VIEW = View(64, 48, pitch_deg=-30.0, fov_y_deg=50.0)
RAYS, RUNS = 64, 8
HEIGHT = -0.6
LYING = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Turns a square so that its u is x, its v is -z and its normal is y."""
LACQUER = Material("principled", (0.0, 0.0, 0.0), alpha=1.0, ior=1.001, clearcoat=0.8)
"""Black below."""
BUMPS = np.float32([0.35, -0.2, 1.0])
BENT = np.float32([-0.15, 0.25, 1.0])
CASES = [(BUMPS, None), (None, BENT), (BUMPS, BENT)]
"""Normals of the map below and of the clear coat's, along u, v and the normal."""
WAYS: list[tuple[Estimator, bool]] = [
    ("delta, even", False),
    ("delta, even", True),
    ("pt-diff, even", False),
]
"""Estimators, and whether their rays start anywhere in a pixel."""


def bumpy(below: Float | None, above: Float | None) -> Material:
    maps = [None if one is None else np.tile(one, (4, 4, 1)) for one in (below, above)]
    return replace(LACQUER, normal_texture=maps[0], clearcoat_normal_texture=maps[1])


def plate(material: Material) -> Instance:
    along_u = np.tile([1.0, 0.0, 0.0, 1.0], (4, 1)).astype(np.float32)
    square = replace(quad((material,)), tangents=along_u)
    return placed(square, (0.0, HEIGHT, -1.1), 0.6, LYING, "plate")


def mirrored(
    o: Float, d: Float, above: Float | None, *, distant: bool = False
) -> tuple[Float, NDArray[np.bool_]]:
    """Return the light that the plate reflects along rays, and whether they meet it well inside.

    `distant`: of walls that are far away.
    """
    t = (HEIGHT - o[..., 1]) / np.where(d[..., 1] < 0.0, d[..., 1], -1e-9)
    point = o + t[..., None] * d
    normal = oracle.normalized(LYING @ (oracle.Z if above is None else above))
    cosine = -(d @ normal)
    up = d + 2.0 * cosine[..., None] * normal
    light, clear = wall_light(np.zeros_like(point) if distant else point, up)
    inside = (np.abs(point - [0.0, HEIGHT, -1.1])[..., [0, 2]] < 0.55).all(-1)
    share = LACQUER.clearcoat * oracle.fresnel(cosine, 1.5)
    seen = inside & clear & (d[..., 1] < 0.0) & (cosine > 0.05) & (up[..., 1] > 0.05)
    return share[..., None] * light, seen


@pytest.mark.parametrize(("below", "above"), CASES)
@pytest.mark.parametrize(("estimator", "jitter"), WAYS)
def test_a_plate_mirrors_the_room(
    device: ComputeDevice,
    below: Float | None,
    above: Float | None,
    estimator: Estimator,
    jitter: bool,
) -> None:
    """As if it were flat without a normal map of its clear coat, else about that map's normal."""
    o = np.zeros((VIEW.height, VIEW.width, 3))
    distant = estimator != "delta, even"
    wanted, seen = mirrored(o, VIEW.directions(), above, distant=distant)
    assert seen.sum() > 300
    found = reflected(device, [plate(bumpy(below, above))], estimator, jitter)[seen]
    assert close(found, wanted[seen]) > 0.95
    # The map below would show elsewhere.
    tilt = below if above is None else None
    other, _ = mirrored(o, VIEW.directions(), tilt, distant=distant)
    assert close(other[seen], wanted[seen]) < 0.5


@pytest.mark.parametrize(("below", "above"), CASES)
@pytest.mark.parametrize(("estimator", "jitter"), WAYS)
def test_a_mirror_shows_the_plate(
    device: ComputeDevice,
    below: Float | None,
    above: Float | None,
    estimator: Estimator,
    jitter: bool,
) -> None:
    d = VIEW.directions()
    standing = placed(quad((MIRROR,)), (0.0, 0.3, -1.75), 0.9, None, "mirror")
    t = -1.75 / np.where(d[..., 2] < 0.0, d[..., 2], -1e-9)
    behind = t[..., None] * d
    distant = estimator != "delta, even"
    wanted, seen = mirrored(behind, d * [1.0, 1.0, -1.0], above, distant=distant)
    first = HEIGHT / np.where(d[..., 1] < 0.0, d[..., 1], -1e-9)
    seen &= (behind[..., 1] > HEIGHT + 0.05) & (first > t) & (np.abs(behind[..., 0]) < 0.85)
    assert seen.sum() > 80
    objects = [plate(bumpy(below, above)), standing]
    found = reflected(device, objects, estimator, jitter)[seen]
    assert close(found, (wanted * MIRROR.albedo)[seen]) > 0.9


@pytest.mark.parametrize("estimator", ["delta, aimed", "pt-diff, aimed"])
@pytest.mark.parametrize("alpha", [0.1, 0.4])
def test_aimed_rays_find_no_other_light(
    device: ComputeDevice, estimator: Estimator, alpha: float
) -> None:
    """Also from below the planes of either normal. No more than all of it is reflected."""
    white = Material("principled", (1.0, 1.0, 1.0), alpha=0.3, metallic=0.5, clearcoat=1.0)
    bumps, bent = np.float32([0.6, -0.9, 1.0]), np.float32([-0.4, 0.2, 1.0])
    maps = {"normal_texture": bumps[None, None], "clearcoat_normal_texture": bent[None, None]}
    objects, frame = [plate(replace(white, clearcoat_alpha=alpha, **maps))], furnace("plain")
    found = []
    for way in (estimator, "delta, even"):
        aim_at = lamps(frame) if way == estimator else None
        with kernels(device, frame, objects, way, aim_at=aim_at, view=VIEW) as run:
            runs = [run.reflected(seed, RAYS) for seed in range(4 * RUNS)]
        _, seen = mirrored(np.zeros((VIEW.height, VIEW.width, 3)), VIEW.directions(), bent)
        light = [0.5 * one["diffuse"][seen] + one["specular"][seen] for one in runs]
        found.append(np.array(light).mean(axis=(1, 2)))
    mean, error = np.mean(found, axis=1), np.std(found, axis=1) / np.sqrt(4 * RUNS)
    assert abs(mean[0] - mean[1]) < 4.0 * np.hypot(*error) + 1e-3
    assert error.max() < 3e-3
    assert 0.5 < mean[1] < 1.0


def test_a_light_below_the_plane_of_the_bumps_shines_on_the_clear_coat(
    device: ComputeDevice,
) -> None:
    """As the twin has it."""
    slope = np.float32([0.0, -1.5, 1.0])
    material = replace(bumpy(slope, None), clearcoat_alpha=0.3)
    place, intensity = (0.0, -0.35, -2.2), 100.0
    light = lit_by(Light("sphere", (intensity,) * 3), place)
    shares = []
    for objects in ([plate(material), light], [plate(material)]):
        with kernels(device, furnace("plain"), objects, "delta, even", view=VIEW) as run:
            runs = [run.reflected(seed, RAYS)["specular"] for seed in range(RUNS)]
        shares.append(np.mean(runs, axis=0)[..., 0])
    d = VIEW.directions()
    t = HEIGHT / np.minimum(d[..., 1], -1e-9)
    point = t[..., None] * d
    seen = (np.abs(point - [0.0, HEIGHT, -1.1])[..., [0, 2]] < 0.55).all(-1)
    away, o = np.array(place) - point[seen], -d[seen]
    i = oracle.normalized(away)
    normal, up = oracle.normalized(LYING @ slope), np.array([0.0, 1.0, 0.0])
    own_o, own_i = oracle.around(normal, o), oracle.around(normal, i)
    f = oracle.clearcoat(material, own_o, own_i, oracle.around(normal, up))
    wanted = intensity * f * np.abs(own_i[:, 2]) / (away**2).sum(-1)
    assert (i @ normal < -0.05).all()
    assert wanted.mean() > 1.0
    found = (shares[0] - shares[1])[seen]
    assert found.mean() == pytest.approx(wanted.mean(), rel=0.02)
    bright = wanted > 0.2 * wanted.max()
    assert np.median(np.abs(found / wanted - 1.0)[bright]) < 0.05


def reflected(
    device: ComputeDevice, objects: list[Instance], estimator: Estimator, jitter: bool
) -> Float:
    frame, trace = room_frame(ROOM, 256, 128, bright_walls), {"jitter": jitter}
    with kernels(device, frame, objects, estimator, view=VIEW, trace=trace) as run:
        return np.mean([run.reflected(seed, RAYS)["specular"] for seed in range(RUNS)], axis=0)


def close(found: Float, wanted: Float) -> float:
    """Return the share of colors that differ by little."""
    return float((np.abs(found - wanted) < 0.06 * wanted.max(-1, keepdims=True)).all(-1).mean())
