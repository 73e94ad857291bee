"""The flux of cells of the irradiance cache, which tells the irradiance of normals between."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import LUMINANCE
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from tests.oracles.worlds import Sphere, World
from tests.world.real.test_irradiance import (
    FLOOR,
    ROOM,
    cell_directions,
    cells,
    fluxes,
    lamp_frame,
    renderer,
    unit,
)
from tests.worlds import ball, ceiling_lamp, panorama_at, room_frame

pytestmark = pytest.mark.gl


def test_cells_hold_the_flux(device: ComputeDevice) -> None:
    """Sum of directions by the light that they bring: float64 Monte Carlo."""
    frame = lamp_frame()
    with renderer(device, frame, rays=1024, samples=1024) as made:
        made.render(1)
        plane, mean, _ = cells(made)
        flux, _ = fluxes(made)
    rng = np.random.default_rng(7)
    known = rng.choice(np.flatnonzero(mean[:, 3] > 0.0), 40, replace=False)
    wanted = []
    for cell in known:
        v, g = cell_directions()[cell], plane[cell, :3].astype(np.float64)
        n = -g / np.linalg.norm(g)
        p = v / (g @ v)
        o = p + 2.0 * np.pi / frame.height * np.linalg.norm(p) * n
        w = n + unit(rng.normal(size=(20_000, 3)))
        w /= np.linalg.norm(w, axis=1, keepdims=True)
        light = panorama_at(frame.color, o + ROOM.first_hit(o, w)[0][:, None] * w) @ LUMINANCE
        shares = light / light.mean() / np.maximum(w @ n, 0.1)
        wanted.append((shares[:, None] * w).mean(0))
    found = flux[known] / (mean[known, :3] @ LUMINANCE)[:, None]
    # What is along the normal is not used.
    along = unit(plane[known, :3])
    found, wanted = (
        f - (f * along).sum(1)[:, None] * along for f in map(np.array, (found, wanted))
    )
    apart = found - wanted
    assert np.sqrt((wanted**2).mean()) > 0.3
    assert np.sqrt((apart**2).mean()) < 0.06
    assert np.abs(apart.mean(0)).max() < 0.02


def test_round_things_narrower_than_cells_receive_what_each_side_faces(
    device: ComputeDevice,
) -> None:
    """A ball on the floor of which cells hold one side at most: float64 Monte Carlo."""
    at = np.array((0.1, FLOOR + 0.06, -1.1))
    world = World(solids=(Sphere(tuple(at), 0.06),))
    frame = room_frame(world, 1024, 512, ceiling_lamp)
    pitch_deg = float(np.degrees(np.arctan2(at[1], -at[2])))
    view = View(48, 36, yaw_deg=5.0, pitch_deg=pitch_deg, fov_y_deg=6.0)
    objects = [ball((0.5, FLOOR + 0.3, -1.3), 0.25, Material(albedo=(0.0, 0.0, 0.0)))]
    with renderer(device, frame, view, objects, rays=256, samples=2048) as made:
        shown = made.render(8, ("irradiance_real",)).aovs["irradiance_real"][..., 1]
    reach, normal, which = world.first_hit(np.zeros(3), view.directions())
    points = reach[..., None] * view.directions()
    on_ball = (which == 1) & ((normal * view.directions()).sum(-1) < -0.5)
    assert on_ball.sum() > 100
    rng = np.random.default_rng(2)
    found, true = [], []
    for row, column in rng.permutation(np.argwhere(on_ball))[:60]:
        p, n = points[row, column], normal[row, column]
        w = n + unit(rng.normal(size=(8000, 3)))
        w /= np.linalg.norm(w, axis=1, keepdims=True)
        o = p + 1e-4 * n
        light = panorama_at(frame.color, o + world.first_hit(o, w)[0][:, None] * w)[:, 1].mean()
        found.append(shown[row, column])
        true.append(light)
    # One E_R for all that a cell holds is off by 0.61.
    error = np.log(np.array(found) / true)
    assert np.sqrt((error**2).mean()) < 0.52
