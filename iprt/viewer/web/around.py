"""The video around the pictures of a browser, which is seen where a turned picture ends."""

from __future__ import annotations

from typing import Any

import numpy as np

from iprt.geometry.camera import View
from iprt.viewer.plain_video import PlainFrame
from iprt.viewer.surroundings import Surroundings
from iprt.viewer.web.picture_plane import AROUND_M, add_picture

NAME = "/around"
OVERLAP = 1.004
"""Size of the cube's faces, relative to those without gaps between them."""


class Around:
    """The faces of a cube with the video, for use by the window's thread.

    Parameters
    ----------
    client : viser.ClientHandle
    """

    def __init__(self, client: Any) -> None:
        self._client = client
        self._faces: dict[str, Any] = {}
        self._shown: Surroundings | None = None

    def show(self, surroundings: Surroundings | None) -> None:
        """Send the video, unless there is none yet or the browser has it."""
        if surroundings is None or surroundings is self._shown:
            return
        self._shown = surroundings
        panorama = PlainFrame(surroundings.pixels.astype(np.float32), 0, surroundings.pose)
        with self._client.atomic():
            for name, view in cube_views(surroundings.pixels.shape[1] // 4).items():
                pixels = np.rint(panorama.seen(view)).astype(np.uint8)
                if name in self._faces:
                    self._faces[name].image = pixels
                else:
                    scene = self._client.scene
                    self._faces[name] = add_picture(scene, f"{NAME}/{name}", pixels, view, AROUND_M)


def cube_views(size: int) -> dict[str, View]:
    """Return the views of a cube's faces, by name; the size is in pixels."""
    fov = float(np.rad2deg(2.0 * np.arctan(OVERLAP)))
    sides = {f"side {yaw}": (float(yaw), 0.0) for yaw in (0, 90, 180, -90)}
    looks = {**sides, "up": (0.0, 90.0), "down": (0.0, -90.0)}
    return {
        name: View(width=size, height=size, yaw_deg=yaw, pitch_deg=pitch, fov_y_deg=fov)
        for name, (yaw, pitch) in looks.items()
    }
