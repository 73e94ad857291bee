"""The views of a scene on a USD stage, as cameras at the capture centre."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, UsdGeom

from iprt.geometry.camera import View
from iprt.output.usd.objects import Times
from iprt.output.usd.prims import place, usable_name
from iprt.scene.scene_view import SceneView

SENSOR_M = 0.024
"""Height of the sensor in metres; with the focal length, it gives the field of view."""
TENTHS = 10.0
"""Apertures and focal lengths are in tenths of the stage's unit."""
CLIPPING_M = (0.01, 10000.0)


def write_views(
    stage: Any, scope: str, views: Iterable[SceneView], time_s: float, times: Times
) -> None:
    """Write each view as a camera below `scope`, at a time and, if it moves, at `times`."""
    taken: list[str] = []
    for view in views:
        name = usable_name(view.name, taken)
        taken.append(name)
        camera = UsdGeom.Camera.Define(stage, f"{scope}/{name}")
        camera.GetPrim().SetDisplayName(view.name)
        now = view.at(time_s)
        samples = [] if view.motion is None else [(code, view.at(s)) for code, s in times]
        place(camera, _transform(now), ((code, _transform(moved)) for code, moved in samples))
        height = TENTHS * SENSOR_M
        camera.CreateVerticalApertureAttr(height)
        camera.CreateHorizontalApertureAttr(height * now.width / now.height)
        camera.CreateClippingRangeAttr(Gf.Vec2f(*CLIPPING_M))
        focal = camera.CreateFocalLengthAttr(_focal_length(now))
        for code, moved in samples:
            focal.Set(_focal_length(moved), code)


def _focal_length(view: View) -> float:
    return 0.5 * TENTHS * SENSOR_M / math.tan(0.5 * math.radians(view.fov_y_deg))


def _transform(view: View) -> NDArray[np.float64]:
    """Return the (4, 4) rotation of a camera, which looks along -Z as views do."""
    transform = np.eye(4)
    transform[:3, :3] = view.world_from_view
    return transform
