"""The video around the pictures of a browser, which is seen where a turned picture ends."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_texel
from iprt.viewer.surroundings import Surroundings
from iprt.viewer.web.camera import quaternion
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
        self._axes = client.scene.add_frame(NAME, show_axes=False)  # of the panorama
        self._faces: dict[str, Any] = {}
        self._shown: Surroundings | None = None

    def show(self, surroundings: Surroundings | None) -> None:
        """Send the video, unless there is none yet or the browser has it."""
        if surroundings is None or surroundings is self._shown:
            return
        self._shown, pose = surroundings, surroundings.pose
        height, width = surroundings.pixels.shape[:2]
        texels = surroundings.pixels.reshape(height * width, 3)
        with self._client.atomic():
            self._axes.wxyz = quaternion(np.eye(3) if pose is None else pose[:3, :3])
            for name, view in cube_views(max(width // 4, 1)).items():
                pixels = texels.take(_places(view, width, height), axis=0)
                if name in self._faces:
                    self._faces[name].image = pixels
                else:
                    path = f"{NAME}/{name}"
                    self._faces[name] = add_picture(
                        self._client.scene, path, pixels, view, 1.0, AROUND_M
                    )


@lru_cache(maxsize=6)
def _places(view: View, width: int, height: int) -> NDArray[np.intp]:
    """Return the flat index (H, W) of the nearest texel of a panorama to each pixel of a view."""
    rows, columns = equirect_texel(view.directions(), width, height)
    return rows * width + columns


def cube_views(size: int) -> dict[str, View]:
    """Return the views of a cube's faces, by name; the size is in pixels."""
    fov = float(np.rad2deg(2.0 * np.arctan(OVERLAP)))
    sides = {f"side {yaw}": (float(yaw), 0.0) for yaw in (0, 90, 180, -90)}
    looks = {**sides, "up": (0.0, 90.0), "down": (0.0, -90.0)}
    return {
        name: View(width=size, height=size, yaw_deg=yaw, pitch_deg=pitch, fov_y_deg=fov)
        for name, (yaw, pitch) in looks.items()
    }
