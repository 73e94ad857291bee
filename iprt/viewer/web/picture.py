"""Transmission of a window's pictures to its browser: lossy during changes, lossless at rest."""

from __future__ import annotations

import contextlib
import time
from collections import deque
from typing import Any

import numpy as np

from iprt.output.display import Bytes
from iprt.viewer.displayed_frame import DisplayedFrame
from iprt.viewer.web.divider import Divider
from iprt.viewer.web.picture_plane import PICTURE_M, add_picture

REST_S = 1.0
"""Seconds without a new picture after which an unrefined one is sent without loss."""
ANSWER_S = 20.0
"""Longest wait for a browser to confirm a picture."""
NAME, NAMES = "/pictures", 4
"""Scene nodes of the pictures, in turn: a name returns when its last picture is gone. Ever new
names would pile up in viser's page."""
BEHIND = 1.05
"""Factor by which a picture moves away when a newer one is sent, so that it ends behind that."""
DECODED_S = 0.5
"""Time after the confirmation of a picture in which the one before stays: the browser may still be
decoding the new one."""


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
        self._pictures: deque[Any] = deque()  # the newest is the last
        self._number = 0
        self._sent: DisplayedFrame | None = None
        self._sent_s = 0.0
        self.lossless = False

    def follow(self, displayed: DisplayedFrame, size: tuple[int, int], split: float) -> bool:
        """Send a new picture, or a lossless version of the last; return True if sent.

        Parameters
        ----------
        displayed : DisplayedFrame
        size : (int, int)
            Width and height of the browser's canvas in pixels.
        split : float
            Position of a division as a fraction of the width, from the left.
        """
        if displayed is not self._sent:
            lossless = displayed.shown.refined
        elif not self.lossless and time.monotonic() - self._sent_s > REST_S:
            lossless = True
        else:
            if time.monotonic() - self._sent_s > DECODED_S:
                self._keep(1)
            return False
        self._send(displayed, size, split, lossless=lossless)
        return True

    def _send(
        self, displayed: DisplayedFrame, size: tuple[int, int], split: float, *, lossless: bool
    ) -> None:
        view, self._number = displayed.shown.request.view, self._number + 1
        pixels, aspect = displayed.pixels, size[0] / size[1]
        if view.projection == "perspective":  # a whole panorama is stretched over the canvas
            pixels = letterboxed(pixels, aspect)
            aspect = pixels.shape[1] / pixels.shape[0]
        with self._client.atomic():
            for picture in self._pictures:
                picture.scale *= BEHIND
            name = f"{NAME}/{self._number % NAMES}"
            scene = self._client.scene
            newest = add_picture(scene, name, pixels, view, aspect, PICTURE_M, lossless=lossless)
            self._pictures.append(newest)
            self._divider.follow(view, size[1], split, displayed.sides)
        self._client.flush()
        # Messages are ordered, so the answer confirms the picture. Suspended or closed tabs never
        # answer.
        with contextlib.suppress(TimeoutError, RuntimeError):
            self._client.local_storage.get_item("iprt", timeout=ANSWER_S)
        self._keep(2)
        self._sent, self._sent_s, self.lossless = displayed, time.monotonic(), lossless

    def _keep(self, newest: int) -> None:
        """Remove all but the newest pictures."""
        while len(self._pictures) > newest:
            self._pictures.popleft().remove()


def letterboxed(pixels: Bytes, aspect: float) -> Bytes:
    """Return a picture with black columns to this aspect ratio, if it is narrower by pixels."""
    height, width = pixels.shape[:2]
    beside = int(0.5 * (height * aspect - width))
    if beside < 1:
        return pixels
    return np.pad(pixels, ((0, 0), (beside + 1, beside + 1), (0, 0)))
