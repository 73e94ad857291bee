"""The last picture, reprojected to the current direction of the view, in its surroundings."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.viewer.surroundings import Surroundings

Matrix = NDArray[np.float64]

BESIDE = (0.05, 0.05, 0.06)
"""Color outside the last picture, without surroundings."""

_VERTEX = """
#version 330
const vec2 CORNERS[3] = vec2[](vec2(0.0, 0.0), vec2(2.0, 0.0), vec2(0.0, 2.0));
out vec2 place;
void main() {
    place = CORNERS[gl_VertexID];
    gl_Position = vec4(2.0 * place - 1.0, 0.0, 1.0);
}
"""
# Rows of textures are stored top down, as imgui displays them, so no axis is flipped.
_FRAGMENT = """
#version 330
uniform sampler2D picture;
uniform mat3 turn;
uniform vec3 beside;
uniform bool surrounded;
uniform sampler2D around;
uniform mat3 to_panorama;
in vec2 place;
out vec4 color;
void main() {
    vec3 there = turn * vec3(place, 1.0);
    vec2 at = there.xy / max(there.z, 1e-9);
    bool seen = there.z > 0.0 && at == clamp(at, 0.0, 1.0);
    vec3 d = normalize(to_panorama * vec3(place, 1.0));
    // As equirect_pixel() in iprt/geometry/equirect.py.
    vec2 texel = vec2(atan(d.x, -d.z) / 6.28318531 + 0.5, acos(clamp(d.y, -1.0, 1.0)) / 3.14159265);
    vec3 other = surrounded ? textureLod(around, texel, 0.0).rgb : beside;
    color = vec4(seen ? textureLod(picture, at, 0.0).rgb : other, 1.0);
}
"""


def turned(view: View, picture: View) -> Matrix | None:
    """Return the homography from a view to a picture rendered from the same place.

    Parameters
    ----------
    view : View
    picture : View
        The view that the picture was rendered for.

    Returns
    -------
    (3, 3) float64 or None
        It maps (x, y, 1), a position in the view as fractions of width and height from the upper
        left, to homogeneous coordinates in the picture; a negative third one lies behind the
        camera. None if both look the same way, or one shows the whole panorama.
    """
    if "equirect" in (view.projection, picture.projection) or _look(view) == _look(picture):
        return None
    to_picture = picture.world_from_view.T @ view.world_from_view
    return np.asarray(np.linalg.inv(_rays(picture)) @ to_picture @ _rays(view))


def turned_place(turn: Matrix | None, x: float, y: float) -> tuple[float, float] | None:
    """Map a position in the view to the picture; None outside the picture."""
    if turn is not None:
        x, y, depth = turn @ (x, y, 1.0)
        if depth <= 0.0:
            return None
        x, y = x / depth, y / depth
    return (float(x), float(y)) if 0.0 <= x < 1.0 and 0.0 <= y < 1.0 else None


def _look(view: View) -> tuple[float, float, float]:
    return view.yaw_deg, view.pitch_deg, view.fov_y_deg


def _rays(view: View) -> Matrix:
    """Return the (3, 3) map from positions in a view, (x, y, 1), to view space."""
    high = float(np.tan(0.5 * np.deg2rad(view.fov_y_deg)))
    wide = high * view.width / view.height
    return np.array([[2.0 * wide, 0.0, -wide], [0.0, -2.0 * high, high], [0.0, 0.0, -1.0]])


def _write(uniform: Any, matrix: Matrix) -> None:
    uniform.write(matrix.T.astype(np.float32).tobytes())


class Turner:
    """A renderer of reprojected pictures into its own texture."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program = context.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        self._program["beside"], self._program["around"] = BESIDE, 1
        self._surroundings: Surroundings | None = None
        self._around: moderngl.Texture | None = None
        self._corners = context.vertex_array(self._program, [])
        self._target: moderngl.Framebuffer | None = None

    def surround(self, surroundings: Surroundings) -> None:
        """Upload the surroundings of pictures, unless they are uploaded already."""
        if surroundings is self._surroundings:
            return
        self._surroundings = surroundings
        height, width = surroundings.pixels.shape[:2]
        if self._around is None or self._around.size != (width, height):
            if self._around is not None:
                self._around.release()
            self._around = self._context.texture((width, height), 3, alignment=1)
            self._around.repeat_y = False
        self._around.write(np.ascontiguousarray(surroundings.pixels), alignment=1)

    def draw(
        self, picture: moderngl.Texture, turn: Matrix, view: View, size: tuple[int, int]
    ) -> moderngl.Texture:
        """Reproject a picture to a view by the matrix of `turned`, at a size in pixels."""
        target = self._sized(size)
        self._program["surrounded"] = self._around is not None
        if self._around is not None and self._surroundings is not None:
            to_panorama = self._surroundings.axes(view) @ _rays(view)
            _write(self._program["to_panorama"], to_panorama)
            self._around.use(1)
        picture.filter = moderngl.LINEAR, moderngl.LINEAR
        picture.repeat_x = picture.repeat_y = False
        picture.use(0)
        _write(self._program["turn"], turn)
        target.use()
        self._corners.render(moderngl.TRIANGLES, 3)
        drawn = target.color_attachments[0]
        assert isinstance(drawn, moderngl.Texture)
        return drawn

    def _sized(self, size: tuple[int, int]) -> moderngl.Framebuffer:
        if self._target is None or self._target.size != size:
            if self._target is not None:
                self._target.color_attachments[0].release()
                self._target.release()
            self._target = self._context.framebuffer([self._context.texture(size, 4)])
        return self._target
