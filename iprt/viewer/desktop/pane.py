"""The picture, and what the mouse does in it."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from iprt.scene.camera import View
from iprt.scene.pose import view_from
from iprt.viewer.desktop import gizmo, overlay
from iprt.viewer.desktop.desk import Desk
from iprt.viewer.desktop.gizmo import GIZMO, Rectangle
from iprt.viewer.desktop.window import Window
from iprt.viewer.objects import ObjectState

Gesture = Literal["press", "look", "slide", "split", "gizmo"]
CLICK_PX = 4.0
"""A press that moves no further is a click."""
SPLIT_PX = 6.0
"""So near the bar that divides the picture can be taken hold of."""
MISFIT = 0.02
"""A picture whose sides differ from the pane's by more is shown with margins."""
_BARE = (
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_bring_to_front_on_focus
    | imgui.WindowFlags_.no_nav
)


class Pane:
    """The part of the window that shows the scene.

    Attributes
    ----------
    rectangle : (left, top, width, height)
        Of the picture, in the window.
    gesture : str or None
        What the mouse is doing in it.
    """

    def __init__(self, desk: Desk, window: Window) -> None:
        self._desk, self._window = desk, window
        self.rectangle: Rectangle = (0.0, 0.0, 0.0, 0.0)
        self.gesture: Gesture | None = None
        self._object: str | None = None  # that was pressed
        self._offset = np.zeros(2)  # from the mouse to the foot of what slides

    def draw(self, area: Rectangle) -> None:
        """The picture in an area of the window, with all that lies over it."""
        left, top, width, height = area
        if width < 1 or height < 1:
            self._desk.cursor = self.gesture = None
            return
        pixels = self._window.pixels_per_unit
        self._desk.viewport.resize(round(width * pixels), round(height * pixels))
        imgui.set_next_window_pos(imgui.ImVec2(left, top))
        imgui.set_next_window_size(imgui.ImVec2(width, height))
        imgui.push_style_var(imgui.StyleVar_.window_padding, imgui.ImVec2(0, 0))
        imgui.push_style_color(imgui.Col_.window_bg, imgui.ImVec4(0.05, 0.05, 0.06, 1.0))
        imgui.begin("picture", None, _BARE)
        imgui.pop_style_color()
        imgui.pop_style_var()
        self.rectangle = self._fitted(area)
        self._draw_picture()
        hovered = imgui.is_window_hovered()
        self._follow_mouse(hovered)
        self._gizmo()
        overlay.split_bar(self._desk, self.rectangle, lit=self._over_split())
        overlay.corners(self._desk, self.rectangle)
        imgui.end()
        overlay.toolbar(self._desk, self.rectangle)
        overlay.activity(self._desk, self.rectangle)
        if hovered and self.gesture is None and not GIZMO.is_over():
            overlay.readout(self._desk)

    def _fitted(self, area: Rectangle) -> Rectangle:
        """Where the picture is; with margins if it has other sides."""
        sight = self._desk.sight
        if sight is None:
            return area
        left, top, width, height = area
        rows, columns = sight.pixels.shape[:2]
        aspect = columns / rows
        if abs(aspect * height / width - 1.0) <= max(MISFIT, 1.0 / min(rows, columns)):
            return area
        shown = min(width, height * aspect), min(height, width / aspect)
        return left + (width - shown[0]) // 2, top + (height - shown[1]) // 2, *shown

    def _draw_picture(self) -> None:
        left, top, width, height = self.rectangle
        pixels = self._window.pixels_per_unit
        picture = self._window.picture(round(width * pixels), round(height * pixels))
        if picture is not None:
            corner = imgui.ImVec2(left + width, top + height)
            imgui.get_window_draw_list().add_image(picture, imgui.ImVec2(left, top), corner)

    # The mouse --------------------------------------------------------------------------------

    def _place(self, x: float, y: float) -> tuple[float, float]:
        """Of a point of the window in the picture."""
        left, top, width, height = self.rectangle
        return (x - left) / width, (y - top) / height

    def _follow_mouse(self, hovered: bool) -> None:
        desk, io = self._desk, imgui.get_io()
        x, y = self._place(io.mouse_pos.x, io.mouse_pos.y)
        desk.cursor = (x, y) if hovered and 0.0 <= x < 1.0 and 0.0 <= y < 1.0 else None
        if hovered and io.mouse_wheel:
            desk.viewport.zoom(io.mouse_wheel)
        if hovered and self.gesture is None:
            self._begin()
        if self.gesture == "press" and imgui.is_mouse_dragging(0, CLICK_PX):
            sliding = self._object is not None and self._object == desk.selected
            self.gesture = "slide" if sliding else "look"
            self._drag(*imgui.get_mouse_drag_delta(0, 0.0))
        elif self.gesture is not None:
            self._drag(io.mouse_delta.x, io.mouse_delta.y)
        if self.gesture is not None and not any(imgui.is_mouse_down(b) for b in (0, 1, 2)):
            if self.gesture == "press":
                desk.selected = self._object
            self.gesture = None

    def _begin(self) -> None:
        desk = self._desk
        if imgui.is_mouse_clicked(1) or imgui.is_mouse_clicked(2):
            self.gesture = "look"
        elif imgui.is_mouse_clicked(0) and self._over_split():
            self.gesture = "split"
        elif imgui.is_mouse_clicked(0) and desk.selected is not None and GIZMO.is_over():
            self.gesture = "gizmo"
            self._take_hold()
        elif imgui.is_mouse_clicked(0):
            self.gesture = "press"
            self._take_hold()
            self._object = None if desk.cursor is None else desk.viewport.object_at(*desk.cursor)

    def _drag(self, dx: float, dy: float) -> None:
        desk = self._desk
        if not (dx or dy):
            return
        if self.gesture == "look":
            pixels = self._window.pixels_per_unit
            desk.viewport.turn(dx * pixels, dy * pixels)
        elif self.gesture == "split":
            x, _ = self._place(imgui.get_io().mouse_pos.x, 0.0)
            desk.viewport.lens = replace(desk.viewport.lens, split=min(max(x, 0.0), 1.0))
        elif self.gesture == "slide":
            self._slide()

    def _over_split(self) -> bool:
        lens, mouse = self._desk.viewport.lens, imgui.get_io().mouse_pos
        left, _, width, _ = self.rectangle
        divided = lens.against is not None and not lens.error
        return divided and abs(mouse.x - left - lens.split * width) <= SPLIT_PX

    # Objects ----------------------------------------------------------------------------------

    def _camera(self) -> tuple[View, NDArray[np.float64] | None] | None:
        """The view that is shown, and the capture centre's pose; None: nothing is."""
        sight = self._desk.sight
        if sight is None or sight.shown.request.view.projection != "perspective":
            return None
        return sight.shown.request.view, sight.shown.pose

    def _foot(self, state: ObjectState) -> NDArray[np.float64]:
        """The middle of an object's lower side, before its transform."""
        low, high = state.corners
        return np.array([0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])])

    def _take_hold(self) -> None:
        """Remember where the foot is from the mouse, so that it does not jump there."""
        state, camera = self._desk.state, self._camera()
        self._offset = np.zeros(2)
        if state is None or camera is None or self._desk.cursor is None:
            return
        matrix = self._desk.placement(state)
        foot = matrix[:3, :3] @ self._foot(state) + matrix[:3, 3]
        view, pose = camera
        if pose is not None:
            foot = (foot - pose[:3, 3]) @ pose[:3, :3]
        pixel = view_from(view, pose).project(foot)
        offset = pixel / (view.width, view.height) - self._desk.cursor
        if np.isfinite(offset).all() and np.abs(offset).max() < 0.5:
            self._offset = offset

    def _slide(self) -> None:
        """Set the object down where the mouse drags its foot."""
        desk, mouse = self._desk, imgui.get_io().mouse_pos
        x, y = self._place(mouse.x, mouse.y) + self._offset
        if desk.selected is not None:
            desk.viewport.drop(desk.selected, x, y, upright=not desk.align)

    def _gizmo(self) -> None:
        state, camera = self._desk.state, self._camera()
        if state is None or camera is None or self.gesture in ("look", "slide"):
            return
        view, pose = camera
        matrix = self._desk.placement(state)
        overlay.box(matrix, state.corners, view, pose, self.rectangle)
        pivot = np.eye(4)
        pivot[:3, 3] = self._foot(state)
        moved = gizmo.manipulate(self.rectangle, view, pose, matrix @ pivot, self._desk.mode)
        if moved is None or self.gesture != "gizmo":
            return
        if gizmo.slides():
            self._slide()
        else:
            pivot[:3, 3] *= -1.0
            self._desk.place(state, moved @ pivot)
