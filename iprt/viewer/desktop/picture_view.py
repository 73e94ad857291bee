"""The picture in the window, and mouse input on it."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from imgui_bundle import imgui

from iprt.geometry.camera import View
from iprt.viewer.desktop import gizmo, overlay
from iprt.viewer.desktop.gizmo import GIZMO, Matrix, Rectangle
from iprt.viewer.desktop.looking_panel import draw_crosses
from iprt.viewer.desktop.turning import BESIDE, turned, turned_place
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.window import Window
from iprt.viewer.looking import pin

Gesture = Literal["press", "look", "slide", "split", "gizmo"]
CLICK_PX = 4.0
"""Movement of a press in pixels up to which it counts as a click."""
SPLIT_PX = 6.0
"""Distance in pixels within which the dividing bar can be grabbed."""
STEP_SCALE = 0.1
"""Step of a factor of size."""
MISFIT = 0.02
"""Relative difference in aspect ratio above which a picture is shown with margins."""
_BARE = (
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_bring_to_front_on_focus
    | imgui.WindowFlags_.no_nav
)


class PictureView:
    """The part of the window that shows the scene.

    Attributes
    ----------
    rectangle : (left, top, width, height)
        The picture in the window.
    gesture : str or None
        Current mouse gesture.
    """

    def __init__(self, ui: DesktopState, window: Window) -> None:
        self._ui, self._window = ui, window
        self.rectangle: Rectangle = (0.0, 0.0, 0.0, 0.0)
        self.gesture: Gesture | None = None
        self._turn: Matrix | None = None  # rotation from the current view to the rendered one
        self._object: str | None = None  # the pressed object
        self._offset = np.zeros(2)  # from the mouse to the foot of the dragged object

    def draw(self, area: Rectangle) -> None:
        """Draw the picture in an area of the window, with all overlays."""
        left, top, width, height = area
        if width < 1 or height < 1:
            self._ui.cursor = self.gesture = None
            return
        pixels = self._window.pixels_per_unit
        self._ui.viewport.resize(round(width * pixels), round(height * pixels))
        imgui.set_next_window_pos(imgui.ImVec2(left, top))
        imgui.set_next_window_size(imgui.ImVec2(width, height))
        imgui.push_style_var(imgui.StyleVar_.window_padding, imgui.ImVec2(0, 0))
        imgui.push_style_color(imgui.Col_.window_bg, imgui.ImVec4(*BESIDE, 1.0))
        imgui.begin("picture", None, _BARE)
        imgui.pop_style_color()
        imgui.pop_style_var()
        self._turn = self._turned()
        self.rectangle = area if self._turn is not None else self._fitted(area)
        self._draw_picture()
        hovered = imgui.is_window_hovered()
        self._follow_mouse(hovered)
        object_box = self._gizmo()
        self._sun_gizmo()
        if self._turn is None:
            draw_crosses(self._ui, self.rectangle)
        overlay.split_bar(self._ui, self.rectangle, lit=self._over_split())
        imgui.end()
        overlay.caption(self._ui, self.rectangle)
        overlay.toolbar(self._ui, self.rectangle)
        overlay.activity(self._ui, self.rectangle)
        if hovered and self.gesture is None:
            overlay.readout(self._ui, self.rectangle, object_box)

    def _turned(self) -> Matrix | None:
        """Return the rotation from the last picture to the view, or None if they agree."""
        displayed = self._ui.displayed
        if displayed is None:
            return None
        return turned(self._ui.viewport.view, displayed.shown.request.view)

    def _fitted(self, area: Rectangle) -> Rectangle:
        """Return the rectangle of the picture, with margins if its aspect ratio differs."""
        displayed = self._ui.displayed
        if displayed is None:
            return area
        left, top, width, height = area
        rows, columns = displayed.pixels.shape[:2]
        aspect = columns / rows
        if abs(aspect * height / width - 1.0) <= max(MISFIT, 1.0 / min(rows, columns)):
            return area
        shown = min(width, height * aspect), min(height, width / aspect)
        return left + (width - shown[0]) // 2, top + (height - shown[1]) // 2, *shown

    def _draw_picture(self) -> None:
        left, top, width, height = self.rectangle
        pixels = self._window.pixels_per_unit
        size = round(width * pixels), round(height * pixels)
        viewport = self._ui.viewport
        if self._turn is None:
            picture = self._window.picture(*size)
        else:
            picture = self._window.turned_picture(
                *size, viewport.view, self._turn, viewport.surroundings
            )
        if picture is not None:
            corner = imgui.ImVec2(left + width, top + height)
            imgui.get_window_draw_list().add_image(picture, imgui.ImVec2(left, top), corner)

    # The mouse --------------------------------------------------------------------------------

    def _place(self, x: float, y: float) -> tuple[float, float]:
        """Return a window point's position in the picture, as fractions of width and height."""
        left, top, width, height = self.rectangle
        return (x - left) / width, (y - top) / height

    def _follow_mouse(self, hovered: bool) -> None:
        ui, io = self._ui, imgui.get_io()
        place = self._place(io.mouse_pos.x, io.mouse_pos.y)
        ui.cursor = turned_place(self._turn, *place) if hovered else None
        if hovered and io.mouse_wheel:
            ui.viewport.zoom(io.mouse_wheel)
        if hovered and self.gesture is None:
            self._begin()
        if self.gesture == "press" and imgui.is_mouse_dragging(0, CLICK_PX):
            sliding = self._object is not None and self._object in ui.selection.names
            self.gesture = "slide" if sliding else "look"
            self._drag(*imgui.get_mouse_drag_delta(0, 0.0))
        elif self.gesture is not None:
            self._drag(io.mouse_delta.x, io.mouse_delta.y)
        if self.gesture is not None and not any(imgui.is_mouse_down(b) for b in (0, 1, 2)):
            if self.gesture == "press" and io.key_shift and ui.cursor is not None:
                pin(ui, *ui.cursor)
            elif self.gesture == "press":
                ui.pick(self._object, more=io.key_ctrl)
            self.gesture = None

    def _begin(self) -> None:
        ui = self._ui
        if imgui.is_mouse_clicked(1) or imgui.is_mouse_clicked(2):
            self.gesture = "look"
        elif imgui.is_mouse_clicked(0) and self._over_split():
            self.gesture = "split"
        elif imgui.is_mouse_clicked(0) and self._gizmo_drawn() and GIZMO.is_over():
            self.gesture = "gizmo"
            self._take_hold()
        elif imgui.is_mouse_clicked(0):
            self.gesture = "press"
            self._object = None if ui.cursor is None else ui.object_at(*ui.cursor)
            if self._object in ui.selection.names:
                ui.selection.select(*ui.selection.names, self._object)  # as the primary one
            self._take_hold()

    def _drag(self, dx: float, dy: float) -> None:
        ui = self._ui
        if not (dx or dy):
            return
        if self.gesture == "look":
            pixels = self._window.pixels_per_unit
            ui.viewport.turn(dx * pixels, dy * pixels)
        elif self.gesture == "split":
            x, _ = self._place(imgui.get_io().mouse_pos.x, 0.0)
            ui.viewport.lens = replace(ui.viewport.lens, split=min(max(x, 0.0), 1.0))
        elif self.gesture == "slide":
            self._slide()

    def _over_split(self) -> bool:
        lens, mouse = self._ui.viewport.lens, imgui.get_io().mouse_pos
        left, _, width, _ = self.rectangle
        divided = lens.against is not None and not lens.error
        return divided and abs(mouse.x - left - lens.split * width) <= SPLIT_PX

    # Objects ----------------------------------------------------------------------------------

    def _view(self) -> View | None:
        """Return the displayed view, or None without a perspective picture."""
        displayed = self._ui.displayed
        if displayed is None or displayed.shown.request.view.projection != "perspective":
            return None
        return displayed.shown.request.view if self._turn is None else self._ui.viewport.view

    def _take_hold(self) -> None:
        """Store the offset from the mouse to the object's foot, to prevent a jump."""
        state, view, mouse = self._ui.state, self._view(), imgui.get_io().mouse_pos
        self._offset = np.zeros(2)
        if state is None or view is None:
            return
        pixel = view.project(state.pivot - self._ui.centre)
        offset = pixel / (view.width, view.height) - self._place(mouse.x, mouse.y)
        if np.isfinite(offset).all() and np.abs(offset).max() < 0.5:
            self._offset = offset

    def _slide(self) -> None:
        """Place the object where the mouse drags its foot."""
        mouse = imgui.get_io().mouse_pos
        place = turned_place(self._turn, *(self._place(mouse.x, mouse.y) + self._offset))
        if place is not None:
            self._ui.drop(*place)

    def _gizmo_drawn(self) -> bool:
        return self._ui.selected is not None or self._ui.selection.sun

    def _gizmo(self) -> overlay.Box | None:
        """Let the gizmo move the selected object; return the box of its outline."""
        ui, state, view = self._ui, self._ui.state, self._view()
        if state is None or view is None:
            return None
        lit = self.gesture in ("slide", "gizmo")
        for other in ui.selection.states[:-1]:
            overlay.outline(other, view, ui.centre, self.rectangle, lit=False)
        overlay.motion_path(ui, state, view, self.rectangle)
        box = overlay.outline(state, view, ui.centre, self.rectangle, lit=lit)
        if self.gesture in ("look", "slide") or state.locked:
            return box
        pivot = np.eye(4)
        pivot[:3, 3] = state.foot
        pivoted = state.to_world @ pivot
        moved = gizmo.manipulate(self.rectangle, view, ui.centre, pivoted, ui.mode, self._step())
        if moved is not None and self.gesture == "gizmo":
            if gizmo.slides():
                self._slide()
            else:
                pivot[:3, 3] *= -1.0
                ui.selection.place(state, moved @ pivot)
        return box

    def _step(self) -> float | None:
        """Return the step of the gizmo's motion; None for free motion."""
        ui = self._ui
        if ui.stepped == imgui.get_io().key_ctrl:
            return None
        return {"move": ui.step_m, "turn": ui.step_deg, "scale": STEP_SCALE}[ui.mode]

    def _sun_gizmo(self) -> None:
        """Draw the arrow of the selected sun, and let the gizmo turn it."""
        ui, view = self._ui, self._view()
        arrow = None if view is None else ui.arrow(view)
        if view is None or arrow is None:
            return
        overlay.sun_arrow(arrow, view, ui.centre, self.rectangle)
        if self.gesture == "look":
            return
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = arrow.turn, arrow.point
        turned = gizmo.manipulate(self.rectangle, view, ui.centre, pose, "turn")
        if turned is not None and self.gesture == "gizmo":
            ui.shine(direction=turned[:3, 1].tolist())
