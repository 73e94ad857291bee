"""Lights without geometry: their table, and where a transform puts them."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.geometry.light import PROFILE_SHAPE, Light
from iprt.geometry.mesh import Instance, light_mesh
from iprt.world.objects.virtual_lights import LIGHT_ROWS, light_rows
from tests.meshes import transform

TURN = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def rows_of(light: Light, linear: np.ndarray, place: tuple[float, ...] = (1, 2, 3)) -> np.ndarray:
    return light_rows([Instance("light", light_mesh(light), transform(linear, place))])


def test_transforms_turn_axes_and_scale_extents_alone() -> None:
    light = Light("rectangle", (1.0, 2.0, 3.0), size=(0.2, 0.4))
    rows = rows_of(light, TURN @ np.diag([2.0, 3.0, 5.0]))
    assert rows.shape == (LIGHT_ROWS, 4)
    np.testing.assert_allclose(rows[0, :3], [1, 2, 3])
    np.testing.assert_allclose(rows[1, :3], [1, 2, 3])
    np.testing.assert_allclose(rows[2, :3], -TURN[:, 2])
    np.testing.assert_allclose(rows[3, :3], TURN[:, 0])
    np.testing.assert_allclose(rows[4, :3], TURN[:, 1])
    np.testing.assert_allclose(rows[5, :2], [0.2, 0.6], rtol=1e-6)
    sphere = rows_of(Light("sphere", radius=0.5), 2.0 * TURN)
    assert sphere[0, 3] == pytest.approx(1.0)


def test_profiles_lie_one_below_the_other() -> None:
    table = np.ones(PROFILE_SHAPE, np.float32)
    lights = [Light(profile=table), Light(), Light(profile=table)]
    instances = [Instance(f"{n}", light_mesh(light), np.eye(4)) for n, light in enumerate(lights)]
    firsts = light_rows(instances)[2::LIGHT_ROWS, 3]
    assert list(firsts) == [0, -1, PROFILE_SHAPE[0]]


@pytest.mark.parametrize(
    "light",
    [
        Light(),
        Light(cone_deg=(20.0, 50.0)),
        Light(cone_deg=(30.0, 30.0)),
        Light(profile=np.cos(np.linspace(0.0, np.pi, 181))[:, None].clip(0.0) * np.ones((1, 73))),
        Light("rectangle"),
    ],
)
def test_solid_angle_is_the_integral_of_the_shares(light: Light) -> None:
    """By summing up the intensity as kernels interpolate it, over 100,000 angles."""
    cosine = 1.0 - 2.0 * (np.arange(100_000) + 0.5) / 100_000
    if light.kind == "rectangle":
        share = np.maximum(cosine, 0.0)
    elif light.profile is not None:
        degrees = np.rad2deg(np.arccos(cosine))
        share = np.interp(degrees, np.arange(181), light.profile[:, 0])
    else:
        scale, offset = rows_of(light, np.eye(3))[3:5, 3].astype(float)
        share = np.clip(cosine * scale + offset, 0.0, 1.0) ** 2
    assert light.solid_angle == pytest.approx(4.0 * np.pi * share.mean(), rel=2e-3)
