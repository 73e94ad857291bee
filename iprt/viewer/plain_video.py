"""The video in a view, without objects: the picture while kernels compile."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from iprt.geometry.pose import view_from
from iprt.renderer import RenderedFrame
from iprt.viewer.session import Shown
from iprt.viewer.state import Request


def plain_video(frame: Frame, request: Request, device: str) -> Shown:
    """Build a picture of a video frame that answers no request."""
    return Shown(
        number=-1,
        step=0,
        request=replace(request, aovs=()),
        frame=frame.index,
        picture=RenderedFrame(resampled(frame, request.view), {}),
        pose=frame.pose,
        geometry=None,
        frames=0,
        noise=None,
        passes=(),
        seconds=0.0,
        device=device,
        compiled=True,
        plain=True,
    )


def resampled(frame: Frame, view: View) -> NDArray[np.float32]:
    """Resample the panorama to a view: (H, W, 3) linear radiance, bilinear."""
    picture = frame.picture
    height, width = picture.shape[:2]
    pixels = equirect_pixel(view_from(view, frame.pose).directions(), width, height) - 0.5
    places = [np.clip(pixels[..., 1], 0, height - 1), pixels[..., 0]]
    channels = [
        map_coordinates(picture[..., channel], places, order=1, mode="grid-wrap")
        for channel in range(3)
    ]
    return np.stack(channels, axis=-1)
