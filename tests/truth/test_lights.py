"""References of lights without geometry: Mitsuba's emitters in the world of a panorama."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from iprt.errors import IprtError
from iprt.geometry.camera import View
from iprt.geometry.light import PROFILE_SHAPE, Light
from iprt.geometry.mesh import Instance, light_mesh
from iprt.truth.lights import instance_lights
from iprt.truth.panorama import load_world, render_reference
from tests.meshes import transform
from tests.worlds import sphere_frame

DOWN = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])


def placed(light: Light) -> Instance:
    return Instance("lamp", light_mesh(light), transform(DOWN, (0.1, 0.0, -0.2)))


@pytest.mark.mitsuba
@pytest.mark.parametrize(
    "light",
    [
        Light(intensity=(2.0, 1.0, 0.5)),
        Light(intensity=(2.0, 1.0, 0.5), radius=0.2),
        Light(intensity=(2.0, 1.0, 0.5), cone_deg=(50.0, 50.0)),
        Light("rectangle", (2.0, 1.0, 0.5), size=(0.02, 0.01)),
    ],
    ids=["point", "sphere", "spot", "rectangle"],
)
def test_lights_have_the_irradiance_of_their_intensity(mi: Any, light: Light) -> None:
    """Inside of a sphere: 1 + I cos β / (π d²), below the light."""
    view = View(24, 24, pitch_deg=-80.0, fov_y_deg=50.0)
    world = load_world(sphere_frame(2.0, 128, 64, 1.0), [placed(light)])
    found = render_reference(world, view, spp=256, clean=False).ratio
    points = 2.0 * view.directions()
    away = np.array([0.1, 0.0, -0.2]) - points
    distance = np.linalg.norm(away, axis=-1)
    factor = -(away * points).sum(-1) / 2.0 / distance**3 / np.pi
    if light.kind == "rectangle":
        factor *= away[..., 1] / distance
    wanted = 1.0 + factor[..., None] * np.array(light.intensity)
    np.testing.assert_allclose(found.mean((0, 1)), wanted.mean((0, 1)), rtol=2e-3)
    assert np.abs(found - wanted).max() < 0.05


@pytest.mark.mitsuba
def test_profiles_are_refused(mi: Any) -> None:
    light = Light(profile=np.ones(PROFILE_SHAPE, np.float32))
    with pytest.raises(IprtError, match="lamp: Mitsuba has no lights with a photometric profile"):
        instance_lights([placed(light)])
