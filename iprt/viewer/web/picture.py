"""Transmission of a window's pictures to its browser: lossy during changes, lossless at rest."""

from __future__ import annotations

import contextlib
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.viewer.displayed_frame import DisplayedFrame
from iprt.viewer.surroundings import Surroundings
from iprt.viewer.web.camera import camera_of, quaternion
from iprt.viewer.web.divider import Divider

QUALITY = 88
"""Quality of JPEG pictures, out of 100."""
REST_S = 1.0
"""Seconds without a new picture after which an unrefined one is sent without loss."""
ANSWER_S = 20.0
"""Longest wait for a browser to confirm a picture."""
PICTURE, AROUND = "/picture", "/around"
"""Scene nodes with the picture's pose, and with the video around it, for `page.js`."""


class PictureSender:
    """A sender of pictures to one browser, for use by one thread.

    It sends a picture after the browser has confirmed the previous one, so that nothing piles up on
    a slow connection.

    Parameters
    ----------
    client : viser.ClientHandle
    divider : Divider
        Updated together with the pictures.

    Attributes
    ----------
    lossless : bool
        True if the last picture was sent without loss.
    """

    def __init__(self, client: Any, divider: Divider) -> None:
        self._client, self._divider = client, divider
        self._pose = client.scene.add_frame(PICTURE, show_axes=False)
        self._around: Any = None
        self._surroundings: Surroundings | None = None
        self._sent: DisplayedFrame | None = None
        self._sent_s = 0.0
        self.lossless = False

    def follow(
        self,
        displayed: DisplayedFrame,
        surroundings: Surroundings | None,
        height_px: int,
        split: float,
    ) -> bool:
        """Send a new picture, or a lossless version of the last; return True if sent.

        Parameters
        ----------
        displayed : DisplayedFrame
        surroundings : Surroundings or None
            Shown where a turned picture ends.
        height_px : int
            Height of the window.
        split : float
            Position of a division as a fraction of the width, from the left.
        """
        if displayed is not self._sent:
            lossless = displayed.shown.refined
        elif not self.lossless and time.monotonic() - self._sent_s > REST_S:
            lossless = True
        else:
            return False
        if surroundings is not None:
            self._surround(surroundings, displayed.shown.request.view)
        self._send(displayed, height_px, split, lossless=lossless)
        return True

    def _surround(self, surroundings: Surroundings, view: View) -> None:
        turn = quaternion(surroundings.axes(view))
        if self._around is not None and surroundings is not self._surroundings:
            self._around.image = surroundings.pixels
        elif self._around is None:
            self._around = self._client.scene.add_image(
                AROUND,
                surroundings.pixels,
                1.0,
                1.0,
                format="jpeg",
                jpeg_quality=QUALITY,
                visible=False,
            )
        self._around.wxyz, self._surroundings = turn, surroundings

    def _send(
        self, displayed: DisplayedFrame, height_px: int, split: float, *, lossless: bool
    ) -> None:
        view = displayed.shown.request.view
        high = float(np.tan(0.5 * np.deg2rad(view.fov_y_deg)))
        extent: NDArray[np.float64] = np.array([high * view.width / view.height, high, 1.0])
        with self._client.atomic():
            self._pose.wxyz = quaternion(camera_of(view))
            self._pose.position = extent
            self._divider.follow(view, height_px, split, displayed.sides)
            self._client.scene.set_background_image(
                displayed.pixels, format="png" if lossless else "jpeg", jpeg_quality=QUALITY
            )
        self._client.flush()
        # Messages are ordered, so the answer confirms the picture. Suspended or closed tabs never
        # answer.
        with contextlib.suppress(TimeoutError, RuntimeError):
            self._client.local_storage.get_item("iprt", timeout=ANSWER_S)
        self._sent, self._sent_s, self.lossless = displayed, time.monotonic(), lossless
