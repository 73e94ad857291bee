"""Open sheets: both sides are seen, whichever way their triangles and normals turn."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import RenderedFrame, Renderer
from iprt.settings.model import Settings
from tests.meshes import mesh_of
from tests.worlds import landscape_frame

VIEW = View(24, 24, fov_y_deg=30.0)
METAL = Material("conductor", (0.9, 0.8, 0.7), alpha=0.05)


def seen(
    device: ComputeDevice, gbuffer: str, tilt_deg: float, *, back: bool, smooth: bool = True
) -> tuple[RenderedFrame, np.ndarray]:
    """A sheet that fills the view, from its front or its back, and its normal towards it."""
    tilt = np.deg2rad(tilt_deg)
    normal = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    along, up = np.array([np.cos(tilt), 0.0, -np.sin(tilt)]), np.array([0.0, 1.0, 0.0])
    corners = [2.0 * (x * along + y * up) for y in (-1, 1) for x in (-1, 1)]
    side = -1.0 if back else 1.0
    triangles = [[0, 2, 1], [1, 2, 3]] if back else [[0, 1, 2], [1, 3, 2]]
    normals = side * normal if smooth else (0.0, 0.0, 0.0)
    mesh = mesh_of(np.array(corners) - (0.0, 0.0, 1.0), triangles, (METAL,), normals)
    settings = Settings.model_validate({"method": "ibl", "gbuffer": gbuffer})
    sheet = Instance("sheet", mesh, np.eye(4))
    with Renderer(device, landscape_frame(64, 32), (sheet,), VIEW, settings) as renderer:
        return renderer.render(4, ("normal",)), normal


@pytest.mark.parametrize("gbuffer", ["cl", "gl"])
@pytest.mark.parametrize("tilt_deg", [0.0, 40.0, -60.0])
def test_backs_are_as_fronts(device: ComputeDevice, gbuffer: str, tilt_deg: float) -> None:
    """Normals face the viewer, and reflections are the same."""
    front, normal = seen(device, gbuffer, tilt_deg, back=False)
    back, _ = seen(device, gbuffer, tilt_deg, back=True)
    bare, _ = seen(device, gbuffer, tilt_deg, back=True, smooth=False)
    for picture in (front, back, bare):
        np.testing.assert_allclose(
            picture.aovs["normal"], np.broadcast_to(normal, (24, 24, 3)), atol=2e-3
        )
        np.testing.assert_allclose(picture.color, front.color, rtol=0.02)
    assert front.color.std() > 0.01 or tilt_deg == 0.0
