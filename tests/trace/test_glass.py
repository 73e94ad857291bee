"""Objects that light passes through: furnaces, a ball by Snell's law, absorption, the sun."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from tests.oracles.brdf import fresnel
from tests.trace.closed_forms import BALL, RUNS, as_large, ball_factor, box_truth
from tests.trace.closed_forms import BOX_VIEW as VIEW
from tests.trace.estimators import PLAIN, Estimator, confirm, furnace, kernels, lamps
from tests.worlds import Float, ball, cuboid, disc, panorama_at, sphere_frame

pytestmark = pytest.mark.thorough

RAYS = 32
IOR = 1.5
CLEAR = Material("dielectric", (1.0, 1.0, 1.0), alpha=0.0, ior=IOR)
WATER = replace(CLEAR, ior=1.33, priority=-1)
PANE = replace(CLEAR, thin=True)
ESTIMATORS: tuple[Estimator, ...] = (
    "delta, aimed", "delta, even", "em, aimed", "pt-diff, aimed", "pt-diff, even",
)  # fmt: skip


def bodies() -> dict[str, list[Instance]]:
    """Objects that are seen in `VIEW`."""
    centre = (0.1, -0.7, -1.0)
    return {
        "ball": [ball(centre, 0.4, CLEAR)],
        "pane": [cuboid(centre, (0.4, 0.3, 0.01), PANE)],
        "block": [cuboid(centre, (0.4, 0.2, 0.3), CLEAR)],
        "bubble": [ball(centre, 0.4, CLEAR), ball(centre, 0.3, WATER)],
        "overlap": [
            cuboid((-0.1, -0.7, -1.0), (0.3, 0.2, 0.2), CLEAR),
            cuboid((0.3, -0.72, -1.0), (0.3, 0.2, 0.2), WATER),
        ],
    }


# Furnaces ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "estimator"),
    [
        *((name, ESTIMATORS[0]) for name in bodies()),
        *(("bubble", estimator) for estimator in ESTIMATORS[1:]),
    ],
)
def test_glass_is_invisible_in_a_furnace(
    device: ComputeDevice, name: str, estimator: Estimator
) -> None:
    """Reflected and refracted light, however often, is as bright as all else."""
    frame, objects = furnace("sphere"), bodies()[name]
    own = {"surfaces": "all"} if estimator.startswith("pt") else None
    with kernels(device, frame, objects, estimator, aim_at=lamps(frame), view=VIEW, own=own) as run:
        inside = run.renderer.layout.interior(run.device.read(run.renderer.visible.id))[0] > 0.0
        found = np.array([run.reflected(s, RAYS)["specular"][inside] for s in range(RUNS)])
    if estimator.startswith("pt"):
        # At the rim, a path that starts beside the mesh may be trapped in the ball.
        found = found[:, binary_erosion(inside, iterations=2)[inside]]
    assert found.shape[1] > 100
    confirm(found.mean(-1), np.ones(found.shape[1]), rounding=2e-3)


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("material", [CLEAR, PANE], ids=["glass", "pane"])
def test_glass_casts_no_shadow_in_a_furnace(
    device: ComputeDevice, material: Material, estimator: Estimator
) -> None:
    """The light that it hides comes through."""
    frame, glass = furnace("plain"), ball(*BALL, material)
    own = {"surfaces": "all"} if estimator.startswith("pt") else None
    with kernels(device, frame, [glass], estimator, aim_at=lamps(frame), own=own) as run:
        factor = ball_factor(*run.receivers(), BALL[0], as_large(glass, BALL[1])).ravel()
        change = np.array([run.change(seed, RAYS) for seed in range(RUNS)])
    confirm(change.mean(-1).reshape(RUNS, -1) + factor, factor, rounding=4e-3)


def test_a_block_that_stands_on_the_plain_loses_what_its_faces_reflect(
    device: ComputeDevice,
) -> None:
    """Below it, rays start inside: they have crossed its bottom, and go straight on."""
    half = np.array([1.5, 0.01, 1.5])
    block = cuboid((0.2, PLAIN + half[1], -0.9), half, CLEAR)
    with kernels(device, furnace("plain"), [block], "delta, even") as run:
        apart = np.abs(run.receivers()[0] - [0.2, PLAIN, -0.9])
        inside = (apart < half - 0.2).all(-1, where=[True, False, True])
        parts = np.array([run.parts(seed, RAYS)[inside] for seed in range(RUNS)])
    assert inside.sum() > 30
    np.testing.assert_allclose(parts[:, :, 0], 1.0, rtol=1e-4)
    sent = parts[:, :, 1].mean()
    cosines = (np.arange(400) + 0.5) / 400
    through = (2.0 * cosines * (1.0 - fresnel(cosines, IOR)) ** 2).mean()
    assert sent == pytest.approx(through, rel=0.02)


# Refraction ----------------------------------------------------------------------------------


CENTRE, RADIUS, WALLS = np.array([0.15, -0.3, -1.1]), 0.45, 2.0


def many_colors(d: Float) -> Float:
    return np.asarray(1.0 + 0.5 * np.sin(4.0 * d[..., [0, 1, 2]] + d[..., [1, 2, 0]]))


def meet_sphere(o: Float, d: Float, centre: Float, radius: float, far: bool) -> Float:
    """Distance along unit d to a sphere, NaN: none."""
    away = o - centre
    b = (away * d).sum(-1)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(b * b - (away * away).sum(-1) + radius * radius)
    return np.asarray(-b + root if far else -b - root)


def seen_through_ball(d: Float, absorption: float) -> Float:
    """(N, 3) radiance along rays (N, 3) from the origin that meet the ball, within `WALLS`.

    The light that leaves after k internal reflections is (1 - R)² R^k; all of a ray's reflections
    are at the same angle.
    """
    picture = many_colors(View(512, 256, projection="equirect").directions())

    def walls(o: Float, way: Float) -> Float:
        hit = o + meet_sphere(o, way, np.zeros(3), WALLS, True)[:, None] * way
        return panorama_at(picture, hit / np.linalg.norm(hit, axis=1, keepdims=True))

    p = meet_sphere(np.zeros(3), d, CENTRE, RADIUS, False)[:, None] * d
    n = (p - CENTRE) / RADIUS
    cosine = -(d * n).sum(-1, keepdims=True)
    reflectance = fresnel(cosine, IOR)
    total = reflectance * walls(p, d + 2.0 * cosine * n)
    inner = np.sqrt(1.0 - (1.0 - cosine**2) / IOR**2)
    way = d / IOR + (cosine / IOR - inner) * n
    share = (1.0 - reflectance) ** 2
    for _ in range(8):
        chord = 2.0 * RADIUS * inner
        share = share * np.exp(-absorption * chord)
        p = p + chord * way
        n = (p - CENTRE) / RADIUS
        out = IOR * way - (IOR * inner - cosine) * n
        total += share * walls(p, out)
        share = share * reflectance
        way = way - 2.0 * (way * n).sum(-1, keepdims=True) * n
    return total


@pytest.mark.parametrize("inner", [None, CLEAR, replace(CLEAR, priority=3)])
@pytest.mark.parametrize("absorption", [0.0, 2.0])
@pytest.mark.parametrize("estimator", ["delta, even", "pt-diff, even"])
def test_a_ball_refracts_as_snell_says(
    device: ComputeDevice, estimator: Estimator, absorption: float, inner: Material | None
) -> None:
    """Also if another ball of the same glass is inside: their border is nothing."""
    dim = (absorption,) * 3
    frame = sphere_frame(WALLS, 512, 256, 1.0)
    directions = View(512, 256, projection="equirect").directions()
    frame = replace(frame, color=many_colors(directions).astype(np.float32))
    objects = [ball(CENTRE, RADIUS, replace(CLEAR, absorption=dim), subdivisions=6)]
    if inner is not None:
        glass = replace(inner, absorption=dim)
        objects.append(ball(CENTRE + np.array([0.05, 0.05, 0.0]), 0.2, glass, subdivisions=5))
    view = View(20, 20, yaw_deg=7.8, pitch_deg=-15.1, fov_y_deg=34.0)
    away = np.linalg.norm(np.cross(view.directions(), CENTRE), axis=-1)
    well = away < 0.85 * RADIUS  # the mesh's rim is coarse
    wanted = seen_through_ball(view.directions()[well], absorption)
    own = {"surfaces": "all"} if estimator.startswith("pt") else None
    with kernels(device, frame, objects, estimator, view=view, own=own) as run:
        found = np.array([run.reflected(s, RAYS)["specular"][well] for s in range(RUNS)])
    assert well.sum() > 150
    for channel in range(3):
        confirm(found[..., channel], wanted[..., channel], rounding=6e-3)


def test_a_slab_absorbs_by_beer_and_lambert(device: ComputeDevice) -> None:
    """R + (1 - R)² a / (1 - R a) in a furnace, with light of both sides, seen from above."""
    half, absorption = (0.9, 0.05, 0.9), (0.0, 4.0, 20.0)
    slab = cuboid((0.0, -0.8, 0.0), half, replace(CLEAR, absorption=absorption))
    view = View(16, 16, pitch_deg=-90.0, fov_y_deg=50.0)
    cosine = -view.directions()[..., 1].ravel()
    inner = np.sqrt(1.0 - (1.0 - cosine**2) / IOR**2)
    once = fresnel(cosine, IOR)
    with kernels(device, furnace("sphere"), [slab], "delta, even", view=view) as run:
        found = np.array([run.reflected(s, RAYS)["specular"] for s in range(RUNS)])
    for channel, coefficient in enumerate(absorption):
        passed = np.exp(-coefficient * 0.1 / inner)
        wanted = once + (1.0 - once) ** 2 * passed / (1.0 - once * passed)
        confirm(found[..., channel].reshape(RUNS, -1), wanted, rounding=2e-3)


# Shares --------------------------------------------------------------------------------------


@pytest.mark.parametrize("metallic", [0.0, 0.3])
def test_a_share_of_the_light_passes(device: ComputeDevice, metallic: float) -> None:
    """A principled sheet in a furnace: a thin wall for some rays, less matte for the others."""
    opaque = Material("principled", (0.8, 0.5, 0.2), alpha=0.05, metallic=metallic)
    mixed = replace(opaque, transmission=0.6, thin=True)
    share = (1.0 - metallic) * mixed.transmission
    sheet = disc((0.1, -0.7, -1.0), 0.5, mixed)
    frame = furnace("sphere")
    with kernels(device, frame, [sheet], aim_at=lamps(frame), view=VIEW) as run:
        runs = [run.reflected(seed, RAYS) for seed in range(RUNS)]
        inside, whole = box_truth(run, opaque)
        _, rest = box_truth(run, replace(opaque, metallic=metallic / (1.0 - share)))
    assert inside.sum() > 100
    diffuse = np.array([one["diffuse"][inside, 0] for one in runs])
    confirm(diffuse, (1.0 - mixed.transmission) * whole["diffuse"], rounding=5e-3)
    once = fresnel(-VIEW.directions()[inside][:, 1], opaque.ior)
    wall = 2.0 * once / (1.0 + once)
    wanted = (1.0 - share) * rest["specular"] + share * (wall + opaque.albedo[0] * (1.0 - wall))
    confirm(np.array([one["specular"][inside, 0] for one in runs]), wanted, rounding=2e-2)


def test_of_equal_priorities_the_last_entered_counts(device: ComputeDevice) -> None:
    """The inner ball shows as with a higher one; with a lower one it is not there."""
    frame = sphere_frame(WALLS, 128, 64, 1.0)
    directions = View(128, 64, projection="equirect").directions()
    frame = replace(frame, color=many_colors(directions).astype(np.float32))
    found = {}
    for priority in (-1, 0, 1):
        inner = replace(CLEAR, ior=1.2, priority=priority)
        objects = [ball(CENTRE, RADIUS, CLEAR), ball(CENTRE, 0.5 * RADIUS, inner)]
        with kernels(device, frame, objects, "delta, even", view=VIEW) as run:
            found[priority] = run.reflected(1, RAYS)["specular"]
    np.testing.assert_array_equal(found[0], found[1])
    assert np.abs(found[0] - found[-1]).max() > 0.1
