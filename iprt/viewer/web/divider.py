"""The bar between the compared pictures, drawn by the browser.

It is an object in the scene, on the picture's plane, and therefore turns with the last picture
until the next one arrives.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.output.display import Bytes
from iprt.viewer.web.camera import camera_of, quaternion
from iprt.viewer.web.handles import show

ROOT = "/divider"
FAR_M = 100.0
"""Distance of the picture's plane. viser marks dragged objects by an arrow with a size in metres,
which is invisible at this distance."""
BAR_PX, GRIP_PX = 16, 26
"""Widths of the draggable parts; the line in the bar is thinner."""
GAP_PX = 12
"""Distance of the labels from the bar and from the picture's upper edge."""
WHITE, DARK = (255, 255, 255, 255), (0, 0, 0, 110)


class Divider:
    """The divider of one browser, for use by the window's thread.

    Parameters
    ----------
    client : viser.ClientHandle
    dragged : callable
        Called by viser's thread with the new position, as a fraction of the window's width.
    """

    def __init__(self, client: Any, dragged: Callable[[float], object]) -> None:
        scene = client.scene
        self._root = scene.add_frame(ROOT, show_axes=False, visible=False)
        self._bar = scene.add_image(f"{ROOT}/bar", bar_pixels(), 1.0, 1.0, format="png")
        self._grip = scene.add_image(f"{ROOT}/grip", grip_pixels(), 1.0, 1.0, format="png")
        self._words = tuple(
            scene.add_label(f"{ROOT}/{side}", "", anchor=f"top-{other}")
            for side, other in (("left", "right"), ("right", "left"))
        )

        async def moved(event: Any) -> None:
            dragged(min(max(float(event.end_screen_pos[0]), 0.0), 1.0))

        for handle in (self._bar, self._grip):
            handle.on_drag("left")(moved)

    def follow(
        self, view: View, height_px: int, split: float, sides: tuple[str, str] | None
    ) -> None:
        """Move the divider to a picture.

        Parameters
        ----------
        view : View
            View of the picture.
        height_px : int
            Height of the window.
        split : float
            Position as a fraction of the width, from the left.
        sides : (str, str) or None
            Names of the pictures left and right of the bar; None without a division.
        """
        show(self._root, "visible", sides is not None)
        if sides is None:
            return
        high = FAR_M * float(np.tan(0.5 * np.deg2rad(view.fov_y_deg)))
        wide, pixel = high * view.width / view.height, 2.0 * high / max(height_px, 1)
        x = (2.0 * split - 1.0) * wide
        self._root.wxyz = quaternion(camera_of(view))
        for handle, width, height in (
            (self._bar, BAR_PX * pixel, 2.0 * high),
            (self._grip, GRIP_PX * pixel, GRIP_PX * pixel),
        ):
            handle.position = (x, 0.0, FAR_M)
            handle.render_width, handle.render_height = width, height
        for handle, text, side in zip(self._words, sides, (-1.0, 1.0), strict=True):
            handle.position = (x + side * GAP_PX * pixel, GAP_PX * pixel - high, FAR_M)
            show(handle, "text", text)


def bar_pixels() -> Bytes:
    """Draw the bar (4, W, 4): a bright line with dark edges, transparent beside it."""
    pixels = np.zeros((4, BAR_PX, 4), np.uint8)
    middle = BAR_PX // 2
    pixels[:, middle - 2 : middle + 2] = DARK
    pixels[:, middle - 1 : middle + 1] = WHITE
    return pixels


def grip_pixels() -> Bytes:
    """Draw the grip (N, N, 4): a bright disc with arrows to both sides."""
    size = 4 * GRIP_PX
    y, x = (np.mgrid[:size, :size] + 0.5) / (0.5 * size) - 1.0
    pixels: NDArray[np.uint8] = np.zeros((size, size, 4), np.uint8)
    disc = np.hypot(x, y)
    pixels[disc < 1.0] = DARK
    pixels[disc < 0.88] = WHITE
    arrows = (np.abs(y) < 0.62 - np.abs(x)) & (np.abs(x) > 0.16)
    pixels[arrows] = (40, 40, 40, 255)
    return pixels
