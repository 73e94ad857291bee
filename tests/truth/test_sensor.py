"""The Mitsuba sensor sees every direction where `View` has it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from iprt.geometry.camera import View
from iprt.geometry.material import Material
from scenes360.modelling import sphere

pytestmark = pytest.mark.mitsuba

VIEWS = [
    View(64, 32, projection="equirect"),
    View(64, 32, yaw_deg=70.0, projection="equirect"),
    View(48, 40, yaw_deg=35.0, pitch_deg=-25.0, fov_y_deg=50.0),
    View(40, 48, yaw_deg=-120.0, pitch_deg=60.0, fov_y_deg=80.0),
]


@pytest.mark.parametrize("view", VIEWS, ids=lambda v: f"{v.projection}{v.yaw_deg:g}")
def test_small_lights_land_on_their_pixels(mi: Any, view: View) -> None:
    from iprt.truth.sensor import sensor

    rng = np.random.default_rng(7)
    integrator = mi.load_dict({"type": "path"})
    for _ in range(3):
        pixel = rng.uniform(6, (view.width - 6, view.height - 6))
        light = {
            "type": "sphere",
            "center": [float(x) for x in 4.0 * view.unproject(pixel)],
            "radius": 0.12,
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 1.0}},
        }
        scene = mi.load_dict({"type": "scene", "light": light})
        image = np.array(mi.render(scene, sensor=sensor(view), integrator=integrator, spp=256))
        seen = image[..., 0]
        y, x = np.mgrid[0 : view.height, 0 : view.width] + 0.5
        centroid = np.array([(seen * x).sum(), (seen * y).sum()]) / seen.sum()
        np.testing.assert_allclose(centroid, pixel, atol=0.15)


@pytest.mark.parametrize("view", VIEWS[1:3], ids=lambda v: v.projection)
def test_depth_and_normal_are_those_of_the_pixel_centres(mi: Any, view: View) -> None:
    from iprt.truth.model import render_geometry

    half = np.array([2.0, 1.5, 3.0])
    box = {"type": "cube", "to_world": mi.ScalarTransform4f().scale([float(h) for h in half])}
    depth, normal = render_geometry({"box": box}, view)
    directions = view.directions()
    distances = half / np.maximum(np.abs(directions), 1e-12)
    np.testing.assert_allclose(depth, distances.min(axis=-1), rtol=2e-6)
    axis = distances.argmin(axis=-1)
    expected = -np.sign(directions) * (np.arange(3) == axis[..., None])
    np.testing.assert_allclose(normal, expected, atol=1e-5)


def test_no_surface_is_depth_zero(mi: Any) -> None:
    from iprt.truth.model import render_geometry

    ball = {"type": "sphere", "center": [0.0, 0.0, -3.0], "radius": 0.5}
    depth, normal = render_geometry({"ball": ball}, View(9, 9))
    assert depth[4, 4] == pytest.approx(2.5, rel=1e-5)
    assert depth[0, 0] == 0.0
    assert not normal[0, 0].any()


def test_mask_is_the_share_of_the_pixel_in_front(mi: Any) -> None:
    from iprt.truth.model import render_mask
    from iprt.truth.shapes import mitsuba_mesh

    def ball(x: float, z: float) -> Any:
        return mitsuba_mesh(sphere(0.5, segments=128).at(x, 0.0, z), {"type": "diffuse"})

    view = View(64, 64, fov_y_deg=40.0)
    mask = render_mask({"real": ball(0.0, -2.0)}, {"near": ball(0.0, -4.0)}, view, seed=0)
    assert not mask.any(), "the real ball hides the object"
    beside = {"real": ball(0.0, -9.0), "other": ball(5.0, -4.0)}
    mask = render_mask(beside, {"object": ball(0.0, -4.0)}, view, seed=0)
    # The silhouette of a centred sphere is a circle of tangent radius / sqrt(d^2 - radius^2).
    area = np.pi * (view.focal_px * 0.5 / np.sqrt(16 - 0.25)) ** 2
    assert mask.sum() == pytest.approx(area, rel=0.01)


def test_textures_stand_upright(mi: Any) -> None:
    """Row 0 of a texture is at v = 1, as the material has it."""
    from iprt.geometry.mesh import Instance, Mesh
    from iprt.truth.sensor import sensor
    from iprt.truth.shapes import instance_shapes

    texture = np.zeros((2, 2, 3), np.float32)
    texture[0, 0] = 1, 0, 0  # top left
    texture[1, 1] = 0, 1, 0  # bottom right
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32)
    quad = Mesh(
        np.c_[corners, np.full(4, -1)].astype(np.float32),
        np.tile(np.float32([0, 0, 1]), (4, 1)),
        (corners + 1) / 2,
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        np.zeros(2, np.int32),
        (Material("diffuse", (1.0, 1.0, 1.0), texture=texture),),
    )
    scene = mi.load_dict(
        {
            "type": "scene",
            "light": {"type": "constant"},
            **instance_shapes([Instance("quad", quad, np.eye(4))]),
        }
    )
    view = View(8, 8, fov_y_deg=80.0)
    image = np.array(
        mi.render(
            scene,
            sensor=sensor(view),
            integrator=mi.load_dict({"type": "direct"}),
            spp=64,
        )
    )
    assert image[1, 1, 0] > 0.5 > image[1, 1, 1]
    assert image[6, 6, 1] > 0.5 > image[6, 6, 0]
    assert image[1, 6].max() < 0.3
