"""The two representations of objects that rays meet, in the whole frame."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.errors import DeviceError
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.settings.model import Settings
from tests.oracles.worlds import World
from tests.rendering import render
from tests.variants import variant
from tests.worlds import ball, bright_walls, ceiling_lamp, cuboid, room_frame

pytestmark = pytest.mark.gl

ROOM = World()
CLAY = Material(albedo=(0.6, 0.3, 0.2))
DOWN = View(80, 60, pitch_deg=-35.0)
MEAN: dict[str, Any] = {"fading": 0.0, "mask": {"sparse": False}, "irradiance": {"rows": 32}}


def settings(*, rays: int = 4, represented: str = "", **others: Any) -> Settings:
    """The default method; or the published estimator, for which objects are so `represented`."""
    estimator = "ratio" if represented else "delta"
    chosen = {**MEAN, "trace": {"rays": rays}, "iprt": {"ratio_rows": 16}, **others}
    return variant(estimator, objects=represented, **chosen)


def test_what_an_object_hides_casts_a_shadow(device: ComputeDevice) -> None:
    """A wall between the camera and a ball: the floor under the ball is dark, beside the wall."""
    frame = room_frame(ROOM, 256, 128, ceiling_lamp)
    wall = cuboid((0.0, -0.45, -1.0), (0.5, 0.5, 0.02), CLAY)
    plate = cuboid((0.2, -0.6, -1.4), (0.5, 0.02, 0.3), CLAY)
    view = View(80, 60, yaw_deg=10.0, pitch_deg=-35.0, fov_y_deg=80.0)
    shadows = {}
    for name in ("triangles", "layers"):
        with_plate = render(device, frame, [wall, plate], view, settings(represented=name), 8)
        without = render(device, frame, [wall], view, settings(represented=name), 8)
        shown = (with_plate.aovs["coverage"] == 0.0) & (without.aovs["coverage"] == 0.0)
        ratio = with_plate.aovs["ratio"].mean(-1) / without.aovs["ratio"].mean(-1)
        d = view.directions()
        t = -1.5 / np.where(d[..., 1] < -0.05, d[..., 1], -1.0)
        floor = t[..., None] * d
        under = (d[..., 1] < -0.05) & shown & (np.abs(floor[..., 0] - 0.65) < 0.15)
        under &= np.abs(floor[..., 2] + 1.4) < 0.25
        shadows[name] = under, ratio
    under, ratio = shadows["triangles"]
    assert under.sum() > 20
    layered = shadows["layers"][1][under].mean()
    assert ratio[under].mean() < layered - 0.05


def test_what_touches_is_dark(device: ComputeDevice) -> None:
    """The corner of two boxes that touch: rays leave by next to nothing and meet the other."""
    frame = room_frame(ROOM, 256, 128, lambda points, _: np.full(points.shape, 1.0))
    white = Material(albedo=(0.8, 0.8, 0.8))
    floor = cuboid((0.0, -0.6, -1.5), (0.8, 0.1, 0.8), white)
    step = cuboid((0.0, -0.3, -1.9), (0.8, 0.2, 0.4), white)
    view = View(24, 96, pitch_deg=-22.0, fov_y_deg=30.0)
    picture = render(device, frame, [floor, step], view, settings(rays=8, atrous={"levels": 0}), 16)
    column = picture.color[:, 4:20].mean((1, 2))
    normal = picture.aovs["normal"][:, 4:20].mean(1)
    corner = int(np.flatnonzero((normal[1:, 1] > 0.7) & (normal[:-1, 2] > 0.7))[0])
    # Half of what lights each surface is the other one, right up to where they meet.
    above, below = column[corner - 1 : corner + 1].mean(), column[corner + 1 : corner + 3].mean()
    away = column[normal[:, 2] > 0.7][:3].mean()
    assert above < 0.93 * away
    assert abs(above - below) < 0.1 * away


@pytest.mark.parametrize("method", ["iprt", "ibl"])
def test_rays_draw_without_opengl(
    device: ComputeDevice, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    """The picture is OpenGL's, except for samples of outlines."""
    frame = room_frame(ROOM, 256, 128, bright_walls)
    objects = [ball((0.2, -1.0, -1.4), 0.3, CLAY)]
    drawn = render(device, frame, objects, DOWN, settings(method=method, gbuffer="gl"), 2)

    def fail(**_: object) -> None:
        raise Exception("libEGL.so not loaded")

    monkeypatch.setattr(moderngl, "create_context", fail)
    traced = render(device, frame, objects, DOWN, settings(method=method), 2)
    np.testing.assert_allclose(traced.aovs["coverage"], drawn.aovs["coverage"], atol=2.01 / 16.0)
    assert np.percentile(np.abs(traced.color - drawn.color), 99) < 0.05
    chosen = render(device, frame, objects, DOWN, settings(method=method, gbuffer="cl"), 2)
    np.testing.assert_array_equal(chosen.color, traced.color)
    for needing in (settings(method=method, gbuffer="gl"), settings(represented="layers")):
        with pytest.raises(DeviceError, match=r"libEGL\.so not loaded"):
            render(device, frame, objects, DOWN, needing, 1)
