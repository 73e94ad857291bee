"""What objects change in the light of real surfaces: closed forms, Monte Carlo, technique by
technique, and how surely at what cost.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import norm, t

from iprt.device import compute
from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.renderer import Renderer
from iprt.resources import CL
from iprt.scene.camera import View
from iprt.scene.frame import Frame
from iprt.scene.material import Material
from iprt.scene.mesh import Instance
from iprt.settings import Settings
from tests.oracles.worlds import Box, Solid, Sphere, World
from tests.worlds import (
    Float,
    ball,
    ceiling_lamp,
    cuboid,
    panorama_at,
    room_frame,
    sphere_frame,
)

pytestmark = pytest.mark.gl

ROOM = World()
FLOOR = ROOM.low[1]
DOWN = View(48, 36, pitch_deg=-35.0)
BLACK = Material(albedo=(0.0, 0.0, 0.0))
WHITE = Material(albedo=(1.0, 1.0, 1.0))
STILL = {"rows": 16, "first_rays": 64, "samples": 64}
"""E_R is the same in all frames, so that the signal times E_R is irradiance, whatever E_R is."""
SURE = {"rows": 32, "first_rays": 4096, "samples": 4096}
"""E_R is well known at once."""
BIAS = 1e-3
"""Metres above a surface from which objects are looked for, in a room."""


def change_of(
    device: ComputeDevice,
    frame: Frame,
    objects: Sequence[Instance],
    view: View,
    *,
    frames: int = 4,
    seed: int = 0,
    filtered: bool = False,
    irradiance: dict[str, int] | None = None,
    **trace: Any,
) -> tuple[Float, Float, Float, Float]:
    """(H, W, 3) blocked and bounce over E_R, E_R / π, ratio."""
    chosen: dict[str, Any] = {
        "seed": seed,
        "fading": 0.0,
        "irradiance": irradiance or {},
        "trace": {"relight_reflections": False, **trace},
    }
    if not filtered:
        chosen |= {"atrous": {"levels": 0}, "mask": {"sparse": False}}
    with Renderer(device, frame, objects, view, Settings.model_validate(chosen)) as renderer:
        aovs = renderer.render(frames, ("irradiance_real", "ratio")).aovs
        assert renderer.real_pixels is not None
        assert renderer.real_pixels.change is not None
        planes = renderer.layout.interior(device.read(renderer.real_pixels.change))
    change = np.moveaxis(planes.astype(np.float64), 0, -1)
    return (
        change[..., :3], change[..., 3:],
        aovs["irradiance_real"].astype(np.float64), aovs["ratio"].astype(np.float64),
    )  # fmt: skip


def blocks(image: Float, side: int = 6) -> Float:
    """(N,) means over squares of pixels of (H, W)."""
    h, w = (n // side * side for n in image.shape)
    parts = image[:h, :w].reshape(h // side, side, w // side, side)
    return np.asarray(parts.mean((1, 3)).ravel())


def agree(samples: Float, wanted: Float, slack: Float) -> None:
    """Means of (runs, N) independent samples are the wanted (N,), by t-tests that together reject a
    right estimator once in 100 times; `slack` (N,) is what the wanted is unsure by.
    """
    runs, count = samples.shape
    # Blocks of like brightness are equally noisy: pooled, the deviations are surer.
    deviation = samples.std(0, ddof=1)
    pooled = np.sqrt((deviation**2).mean())
    error = np.maximum(deviation, 0.5 * pooled) / np.sqrt(runs)
    threshold = t.isf(0.5 * (1.0 - 0.99 ** (1.0 / count)), runs - 1)
    apart = np.abs(samples.mean(0) - wanted)
    assert (apart < threshold * error + slack).all(), (apart / (error + slack)).max()


def surface_points(world: World, view: View) -> tuple[Float, Float]:
    """(H, W, 3) what pixels' centres see, and normals there."""
    d = view.directions()
    distance, normal, _ = world.first_hit(np.zeros(3), d)
    return distance[..., None] * d, normal


# Furnaces ------------------------------------------------------------------------------------


def test_a_black_ball_blocks_its_form_factor(device: ComputeDevice) -> None:
    """(r / d)² cos β of the light, where all of it is above the horizon (d to its centre)."""
    solid = Sphere((0.3, -0.2, -0.9), 0.35)
    frame = sphere_frame(2.0, 128, 64, 0.7)
    objects = [ball(solid.centre, solid.radius, BLACK, subdivisions=5)]
    view = View(48, 36, yaw_deg=60.0)
    d = view.directions()
    to_centre = np.asarray(solid.centre) - (2.0 - BIAS) * d
    distance = np.linalg.norm(to_centre, axis=-1)
    cosine = -(to_centre * d).sum(-1) / distance
    wanted = (solid.radius / distance) ** 2 * cosine
    seen = solid.interval(np.zeros_like(d), d)[0]
    usable = (distance * cosine > solid.radius) & ~np.isfinite(seen)
    assert usable.mean() > 0.5
    runs = []
    for seed in range(6):
        blocked, bounce, real, _ = change_of(device, frame, objects, view, seed=seed, rays=4)
        assert bounce.max() == 0.0
        np.testing.assert_allclose(real[usable], 0.7, rtol=1e-5)
        runs.append(blocks(np.where(usable, blocked[..., 0], 0.0)))
    exact = blocks(np.where(usable, wanted, 0.0))
    assert exact.max() > 0.03
    agree(np.array(runs), exact, 0.004 * exact + 1e-6)
    # Over all of them, to a third of a percent: the mesh is as good as the ball.
    assert np.mean(runs) == pytest.approx(exact.mean(), rel=3e-3)


@pytest.mark.parametrize("light_sampling", [False, True])
def test_a_white_ball_in_a_furnace_changes_nothing(
    device: ComputeDevice, light_sampling: bool
) -> None:
    """It sends back what it hides."""
    frame = sphere_frame(2.0, 128, 64, 0.7)
    objects = [ball((0.3, -0.2, -0.9), 0.35, WHITE)]
    blocked, bounce, _, ratio = change_of(
        device, frame, objects, View(48, 36, yaw_deg=60.0), light_sampling=light_sampling
    )
    assert blocked.max() > 0.02
    np.testing.assert_allclose(bounce, blocked, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(ratio, 1.0, atol=1e-4)


# Monte Carlo ---------------------------------------------------------------------------------

PLATE = Box((0.2, FLOOR + 0.5, -1.3), (0.5, 0.02, 0.35))
BALL = Sphere((0.2, FLOOR + 0.35, -1.4), 0.3)
RED = Material(albedo=(0.9, 0.5, 0.1))


def cosine_about(normal: Float, rng: np.random.Generator) -> Float:
    d = rng.normal(size=normal.shape)
    d = normal + d / np.linalg.norm(d, axis=-1, keepdims=True)
    return np.asarray(d / np.linalg.norm(d, axis=-1, keepdims=True))


def truth(
    frame: Frame, solid: Solid, albedo: Float, view: View, side: int = 6, count: int = 30_000
) -> tuple[Float, Float, Float]:
    """(N, 2, 3) blocked and bounced irradiance / π of squares of pixels, errors, usable (N,).

    Float64, in the true room with the panorama's radiance, whose rays start as far above the floor
    as ours. Squares that show a wall or the solid are not usable.
    """
    rng = np.random.default_rng(7)
    lift = 2.0 * np.pi / frame.height
    means, errors, usable = [], [], []
    d = view.directions()
    point, normal = surface_points(ROOM, view)
    plain = (normal[..., 1] > 0.5) & ~np.isfinite(solid.interval(np.zeros_like(d), d)[0])
    for y in range(0, view.height // side * side, side):
        for x in range(0, view.width // side * side, side):
            square = (slice(y, y + side), slice(x, x + side))
            usable.append(plain[square].all())
            if not usable[-1]:
                means.append(np.zeros((2, 3)))
                errors.append(np.ones((2, 3)))
                continue
            p = np.resize(point[square].reshape(-1, 3), (count, 3))
            up = np.tile([0.0, 1.0, 0.0], (count, 1))
            w = cosine_about(up, rng)
            from_real = p + lift * np.linalg.norm(p, axis=1, keepdims=True) * up
            from_object = p + BIAS * up

            def light(o: Float, along: Float) -> Float:
                reach = ROOM.first_hit(o, along)[0]
                return panorama_at(frame.color, o + reach[:, None] * along)

            enter, _, facing, _ = solid.interval(from_object, w)
            met = np.isfinite(enter) & (enter > 0.0)
            hidden, sent = np.zeros((2, count, 3))
            hidden[met] = light(from_real[met], w[met])
            at = from_object[met] + enter[met, None] * w[met]
            out = cosine_about(facing[met], rng)
            sent[met] = albedo * light(at, out)
            means.append(np.stack([hidden.mean(0), sent.mean(0)]))
            errors.append(np.stack([hidden.std(0), sent.std(0)]) / np.sqrt(count))
    return np.array(means), np.array(errors), np.array(usable)


SCENES: dict[str, tuple[Solid, list[Instance], Material]] = {
    "plate": (PLATE, [cuboid(PLATE.centre, PLATE.half, BLACK)], BLACK),
    "ball": (BALL, [ball(BALL.centre, BALL.radius, RED, subdivisions=5)], RED),
}


def absolute(
    device: ComputeDevice, frame: Frame, objects: list[Instance], runs: int, **others: Any
) -> Float:
    """(runs, N, 2, 3) blocked and bounced irradiance / π of squares of pixels."""
    found = []
    for seed in range(runs):
        blocked, bounce, real, _ = change_of(
            device, frame, objects, DOWN, seed=seed, irradiance=STILL, **others
        )
        found.append(
            [[blocks(part[..., c] * real[..., c]) for c in range(3)] for part in (blocked, bounce)]
        )
    return np.moveaxis(np.array(found), -1, 1)


@pytest.mark.parametrize("light_sampling", [False, True], ids=["even", "aimed"])
@pytest.mark.parametrize("name", SCENES)
def test_light_blocked_and_bounced_is_monte_carlos(
    device: ComputeDevice, name: str, light_sampling: bool
) -> None:
    solid, objects, material = SCENES[name]
    frame = room_frame(ROOM, 256, 128, ceiling_lamp)
    wanted, error, usable = truth(frame, solid, np.array(material.albedo), DOWN)
    assert usable.sum() > 15
    found = absolute(device, frame, objects, 6, rays=8, light_sampling=light_sampling)
    for part, channel in ((0, 0), *(((1, 0), (1, 2)) if material is RED else ())):
        exact = wanted[usable, part, channel]
        slack = 3.0 * error[usable, part, channel] + 0.01 * exact + 0.002 * exact.max()
        agree(found[:, usable, part, channel], exact, slack)
        assert exact.max() > 10.0 * slack.min()


@contextmanager
def shares(
    folder: Path, monkeypatch: pytest.MonkeyPatch, box: str, light: str
) -> Iterator[ComputeDevice]:
    """A device whose kernels choose directions in other proportions."""
    copy = folder / f"cl_{box}_{light}"
    shutil.copytree(CL, copy)
    file = copy / "trace_delta.cl"
    source, replaced = re.subn(
        r"(#define BOX_SHARE(?:_INSIDE)?) .*", rf"\1 {box}", file.read_text()
    )
    source, more = re.subn(r"0\.5f \* \(1\.0f - s\.box_share\)", light, source)
    assert (replaced, more) == (2, 1)
    file.write_text(source)
    with monkeypatch.context() as patched:
        patched.setattr(compute, "CL", copy)
        yield ComputeDevice(choose_device("pocl"))


@pytest.mark.parametrize(
    ("box", "light"),
    [("0.0f", "0.0f"), ("0.9f", "0.0f"), ("0.02f", "0.9f")],
    ids=["cosine", "boxes", "lights"],
)
def test_each_way_to_choose_directions_finds_the_same(
    device: ComputeDevice,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    box: str,
    light: str,
) -> None:
    frame = room_frame(ROOM, 128, 64, ceiling_lamp)
    objects = SCENES["ball"][1]
    mixed = absolute(device, frame, objects, 6, rays=8)
    with shares(tmp_path, monkeypatch, box, light) as other:
        alone = absolute(other, frame, objects, 6, rays=8)
    for part in (0, 1):
        a, b = mixed[:, :, part, 0], alone[:, :, part, 0]
        assert a.mean() > 0.01
        slack = 4.0 * a.std(0, ddof=1) / np.sqrt(len(a)) + 0.003 * a.max()
        agree(b, a.mean(0), slack)
        error = np.hypot(*(np.std(s.mean(1), ddof=1) / np.sqrt(len(s)) for s in (a, b)))
        assert abs(a.mean() - b.mean()) < 4.5 * error + 2e-3 * a.mean()


def test_both_estimators_find_the_same(device: ComputeDevice) -> None:
    frame = room_frame(ROOM, 128, 64, ceiling_lamp)
    objects = SCENES["ball"][1]
    found = {
        name: np.array(
            [
                blocks(change_of(device, frame, objects, DOWN, seed=seed, irradiance=SURE, rays=16,
                                 frames=8, estimator=name)[3][..., 0])
                for seed in range(5)
            ]
        )
        for name in ("delta", "ratio")
    }  # fmt: skip
    delta, ratio = found["delta"], found["ratio"]
    assert ratio.mean(0).min() < 0.7
    error = np.sqrt((delta.var(0, ddof=1) + ratio.var(0, ddof=1)) / len(delta))
    threshold = norm.isf(0.5 * (1.0 - 0.99 ** (1.0 / delta.shape[1])))
    apart = np.abs(delta.mean(0) - ratio.mean(0))
    assert (apart < 1.5 * threshold * error + 0.02).all()


def test_less_than_a_third_of_the_variance_at_equal_rays(device: ComputeDevice) -> None:
    """Of the quotient after 16 frames of one ray per pixel, below a lamp."""
    frame = room_frame(ROOM, 128, 64, ceiling_lamp)
    objects = SCENES["ball"][1]

    def variance(**trace: Any) -> float:
        runs = [
            change_of(device, frame, objects, DOWN, frames=16, seed=s, irradiance=SURE, **trace)[3]
            for s in range(8)
        ]
        return float(np.var(runs, axis=0, ddof=1).mean())

    aimed = variance()
    even = variance(light_sampling=False)
    ratio = variance(estimator="ratio", light_sampling=False)
    print(f"variance: delta, aimed {aimed:.4f}; delta {even:.4f}; ratio {ratio:.4f}")
    assert aimed < 0.33 * ratio
    assert aimed < even


# Bits ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("filtered", [False, True], ids=["raw", "filtered"])
def test_nothing_changes_where_all_objects_are_below_the_horizon(
    device: ComputeDevice, filtered: bool
) -> None:
    hidden = World(solids=(Box((-0.2, -0.2, -1.3), (1.5, 1.0, 0.1)),))
    behind = Sphere((1.9, -1.1, -1.5), 0.15)
    view = View(48, 36, yaw_deg=25.0, pitch_deg=-4.0)
    frame = room_frame(hidden, 128, 64, ceiling_lamp)
    objects = [ball(behind.centre, behind.radius, RED)]
    blocked, bounce, _, ratio = change_of(device, frame, objects, view, filtered=filtered)
    point, normal = surface_points(hidden, view)
    # The whole box around the ball, and what the filter reaches.
    height = (np.asarray(behind.centre) - point) * normal
    reach = np.abs(normal).sum(-1) * behind.radius * 1.05
    below = height.sum(-1) + reach < 0.0
    assert below.mean() > 0.3
    for planes in (blocked, bounce):
        assert not planes[below].any()
        assert planes.max() > 0.0
    assert (ratio[below] == 1.0).all()


def test_two_runs_are_equal(device: ComputeDevice) -> None:
    frame = room_frame(ROOM, 128, 64, ceiling_lamp)
    first, again = (
        change_of(device, frame, SCENES["ball"][1], DOWN, filtered=True) for _ in range(2)
    )
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a, b)


# What virtual surfaces reflect ---------------------------------------------------------------


@pytest.mark.parametrize(
    "material",
    [
        Material(albedo=(0.8, 0.8, 0.8)),
        Material("plastic", (0.5, 0.5, 0.5), alpha=0.2),
        Material("conductor", (0.9, 0.9, 0.9), alpha=0.4),
    ],
    ids=["diffuse", "plastic", "conductor"],
)
def test_aiming_at_lights_leaves_objects_as_bright(
    device: ComputeDevice, material: Material
) -> None:
    """And less noisy."""
    frame = room_frame(ROOM, 128, 64, ceiling_lamp)
    objects = [ball((0.2, -0.3, -1.4), 0.4, material)]
    view = View(32, 24, pitch_deg=-10.0)

    def pictures(light_sampling: bool) -> NDArray[np.float32]:
        trace = {"rays": 4, "relight_reflections": False, "light_sampling": light_sampling}
        raw = {"fading": 0.0, "atrous": {"levels": 0}, "mask": {"sparse": False}, "trace": trace}
        runs: list[NDArray[np.float32]] = []
        for seed in range(8):
            chosen = Settings.model_validate({"seed": seed, **raw})
            with Renderer(device, frame, objects, view, chosen) as renderer:
                shown = renderer.render(4, ("coverage",))
            runs.append(shown.color[shown.aovs["coverage"] == 1.0].mean(-1))
        return np.array(runs)

    aimed, even = pictures(True), pictures(False)
    means = [runs.mean(1) for runs in (aimed, even)]
    error = np.sqrt(sum(m.var(ddof=1) / len(m) for m in means))
    assert abs(means[0].mean() - means[1].mean()) < 4.0 * error
    assert error < 0.03 * means[1].mean()
    assert aimed.var(0, ddof=1).mean() < 0.7 * even.var(0, ddof=1).mean()
