"""The gizmo over the picture, which moves, rotates and scales an object."""

from __future__ import annotations

from typing import Literal

import numpy as np
from imgui_bundle import imguizmo
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.viewer.gizmo import camera_matrix, projection_matrix

GIZMO = imguizmo.im_guizmo
Matrix = NDArray[np.float64]
Mode = Literal["move", "turn", "scale"]
Rectangle = tuple[float, float, float, float]
"""A rectangle on the screen: left, top, width and height."""

_OPERATIONS = {
    "move": GIZMO.OPERATION.translate,
    "turn": GIZMO.OPERATION.rotate,
    "scale": GIZMO.OPERATION.scale,
}
_SPACES = {
    "move": GIZMO.MODE.world,
    "turn": GIZMO.MODE.world,
    "scale": GIZMO.MODE.local,
}


def manipulate(
    rectangle: Rectangle,
    view: View,
    centre: Matrix,
    to_world: Matrix,
    mode: Mode,
    step: float | None = None,
) -> Matrix | None:
    """Draw the gizmo of an object in the current window; return the object's new transform.

    Parameters
    ----------
    rectangle : (left, top, width, height)
        The picture on the screen.
    view : View
    centre : (3,) float64
        World position of the capture centre.
    to_world : (4, 4) float64
    mode : {"move", "turn", "scale"}
    step : float or None
        Steps of the motion, in metres, degrees or factors by the mode; None for free motion.

    Returns
    -------
    (4, 4) float64 or None
        None if the gizmo is not dragged.
    """
    GIZMO.set_orthographic(False)
    GIZMO.allow_axis_flip(False)
    GIZMO.set_drawlist()
    GIZMO.set_rect(*rectangle)
    matrix = _columns(to_world)
    GIZMO.manipulate(
        _columns(camera_matrix(view, centre)),
        _columns(projection_matrix(view)),
        _OPERATIONS[mode],
        _SPACES[mode],
        matrix,
        snap=None if step is None else GIZMO.Matrix3([step] * 3),
    )
    if not GIZMO.is_using():
        return None
    moved: Matrix = np.reshape(np.array(matrix.values, np.float64), (4, 4)).T
    return moved


def slides() -> bool:
    """Return True if the gizmo's centre is dragged, which moves freely in the picture."""
    return bool(GIZMO.get_active_handle_type() == GIZMO.MOVETYPE.mt_move_screen)


def _columns(matrix: Matrix) -> GIZMO.Matrix16:
    return GIZMO.Matrix16([float(value) for value in matrix.T.ravel()])
