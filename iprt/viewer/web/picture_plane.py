"""Pictures in the browser's scene, each at the pose that it was made for.

They are the images of viser's camera frustums: the browser draws such an image from when it is
decoded, at its own pose, in its exact colors, and turns it with the scene. From the capture centre,
the distance of a picture is invisible; it only orders pictures, gizmos and the video around.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from iprt.geometry.camera import View
from iprt.output.display import Bytes
from iprt.viewer.web.camera import camera_of, quaternion

QUALITY = 88
"""Quality of JPEG pictures, out of 100."""
PICTURE_M, AROUND_M = 600.0, 5300.0
"""Distances of the newest picture, and of the video around. The corners of the widest picture are
at 8.4 times its distance, and still before the video around."""
FAR_M = 10_000.0
"""Distance that the browser draws to, beyond the corners of the video around."""


def add_picture(
    scene: Any,
    name: str,
    pixels: Bytes,
    view: View,
    aspect: float,
    distance_m: float,
    *,
    lossless: bool = False,
) -> Any:
    """Add a picture to a scene; the browser draws it as soon as it is decoded.

    Parameters
    ----------
    scene : viser.SceneApi
    name : str
    pixels : (H, W, 3) uint8
    view : View
        Its vertical field of view is the picture's height.
    aspect : float
        Width relative to the height.
    distance_m : float
        Distance of the picture's plane from the capture centre, in metres.
    lossless : bool
        As PNG, not as JPEG.

    Returns
    -------
    viser.CameraFrustumHandle
    """
    fov = float(np.deg2rad(view.fov_y_deg))
    # viser's scale is the cube root of a frustum's volume.
    volume = aspect * np.tan(0.5 * fov) ** 2 / 3.0
    return scene.add_camera_frustum(
        name,
        fov,
        aspect,
        scale=distance_m * float(np.cbrt(volume)),
        thickness=0.0,
        thickness_units="screen",
        image=pixels,
        format="png" if lossless else "jpeg",
        jpeg_quality=QUALITY,
        wxyz=quaternion(camera_of(view)),
        cast_shadow=False,
        receive_shadow=False,
    )
