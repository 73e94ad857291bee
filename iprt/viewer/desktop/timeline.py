"""The timeline above the bars: rows of keys that are chosen, dragged and copied."""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.viewer.desktop.gizmo import Rectangle
from iprt.viewer.desktop.style import ACCENT, FIELD, LINE, QUIET, TEXT, packed
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.widgets import action_button, toggle
from iprt.viewer.timeline import Chosen, Row
from iprt.viewer.timeline_fields import key_fields, record_field, timeline_actions

LABEL_EM = 9.0
ROWS = 3
"""Number of rows without scrolling; the height is the same for fewer, so that the picture stays."""
REACH_EM = 0.5
"""Distance from a key's middle within which it is clicked."""
DRAG_PX = 3.0
MARGIN_EM = 0.8
TICKS_EM = 5.0
"""Least distance of the numbers above the rows."""


@dataclass(frozen=True)
class _Axis:
    """Places of frames on the screen."""

    left: float
    width: float
    first: int
    last: int

    def x(self, frame: float) -> float:
        return self.left + self.width * (frame - self.first) / (self.last - self.first)

    def frame(self, x: float) -> int:
        at = self.first + (x - self.left) / self.width * (self.last - self.first)
        return min(max(round(at), self.first), self.last)


class TimelineStrip:
    """The timeline of the selected objects and of the view.

    Attributes
    ----------
    places : dict of Chosen to (x, y)
        Middles of the drawn keys in the window.
    """

    def __init__(self, ui: DesktopState) -> None:
        self._ui = ui
        self.places: dict[Chosen, tuple[float, float]] = {}
        self._axis = _Axis(0.0, 1.0, 0, 1)
        self._grabbed: Chosen | None = None

    @property
    def height(self) -> float:
        """Height in the window; 0 if nothing can move and no key is set."""
        ui = self._ui
        if len(ui.frames) == 1 and not any(row.keys for row in ui.timeline.rows):
            return 0.0
        rows = ROWS * imgui.get_text_line_height_with_spacing()
        return imgui.get_frame_height() + rows + 3.0 * imgui.get_style().item_spacing.y

    def draw(self, area: Rectangle, flags: int) -> None:
        """Draw it in an area of the window, as an imgui window with flags."""
        left, top, width, height = area
        imgui.set_next_window_pos(imgui.ImVec2(left, top))
        imgui.set_next_window_size(imgui.ImVec2(width, height))
        padding = imgui.ImVec2(imgui.get_style().window_padding.x, imgui.get_style().item_spacing.y)
        imgui.push_style_var(imgui.StyleVar_.window_padding, padding)
        imgui.begin("timeline", None, flags)
        imgui.pop_style_var()
        self._ruler()
        imgui.begin_child("keys")
        self.places.clear()
        for row in reversed(self._ui.timeline.rows):
            self._row(row)
        self._menu()
        imgui.end_child()
        imgui.end()

    def _ruler(self) -> None:
        """Draw the buttons, and the numbers of frames, where dragging moves the video."""
        ui, em = self._ui, imgui.get_font_size()
        record = record_field(ui)
        if toggle(f"{icons.ICON_FA_CIRCLE}##record", record.read(), record.label().about):
            record.write(not record.read())
        imgui.same_line()
        key = timeline_actions(ui)["key"]
        action_button(key, icons.ICON_FA_KEY, width=2.0 * imgui.get_frame_height(), short=True)
        imgui.same_line(LABEL_EM * em)
        origin, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
        first, last = ui.frames[0], max(ui.timeline.last_frame, ui.frames[0] + 1)
        margin = MARGIN_EM * em
        self._axis = axis = _Axis(origin.x + margin, max(room - 2 * margin, 1.0), first, last)
        imgui.invisible_button("##ruler", imgui.ImVec2(max(room, 1.0), imgui.get_frame_height()))
        if imgui.is_item_active():
            ui.engine.seek(axis.frame(imgui.get_io().mouse_pos.x))
        draw, most = imgui.get_window_draw_list(), max(axis.width / (TICKS_EM * em), 1.0)
        step = _round_step((last - first) / most)
        for frame in range(first, last + 1, step):
            x = axis.x(frame)
            draw.add_line(
                imgui.ImVec2(x, origin.y), imgui.ImVec2(x, origin.y + 0.4 * em), packed(QUIET)
            )
            draw.add_text(imgui.ImVec2(x + 0.3 * em, origin.y), packed(QUIET), str(frame))

    def _row(self, row: Row) -> None:
        ui, em, axis = self._ui, imgui.get_font_size(), self._axis
        height, mouse = imgui.get_text_line_height(), imgui.get_io().mouse_pos
        turned = row.of_view and ui.viewport.name != row.name
        imgui.text_colored(imgui.ImVec4(*QUIET), f"{row.name}{' (turned)' if turned else ''}")
        imgui.same_line(LABEL_EM * em)
        origin, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
        draw = imgui.get_window_draw_list()
        corner = imgui.ImVec2(origin.x + room, origin.y + height)
        draw.add_rect_filled(origin, corner, packed(FIELD if row.of_view else LINE, 0.6), 2.0)
        size = imgui.ImVec2(max(room, 1.0), height)
        imgui.invisible_button(f"##row {row.of_view} {row.name}", size)
        middle = origin.y + 0.5 * height
        x = axis.x(ui.frame)
        draw.add_line(imgui.ImVec2(x, origin.y), imgui.ImVec2(x, corner.y), packed(ACCENT), 1.0)
        for key in row.keys:
            place = axis.x(ui.timeline.frame_of(key.time)), middle
            self.places[row.key(key.time)] = place
        self._follow_mouse(row)
        self._diamonds(row, 0.35 * em, draw)
        if imgui.is_item_hovered() and imgui.is_mouse_double_clicked(0):
            ui.engine.seek(axis.frame(mouse.x))

    def _follow_mouse(self, row: Row) -> None:
        """Choose, move and copy keys of a row by the mouse on it."""
        timeline, io = self._ui.timeline, imgui.get_io()
        if imgui.is_item_hovered() and (imgui.is_mouse_clicked(0) or imgui.is_mouse_clicked(1)):
            hit = self._hit(row)
            if imgui.is_mouse_clicked(1):
                if hit is not None:
                    self._choose(hit)
                    imgui.open_popup("key")
            elif imgui.is_item_active():
                self._grabbed = hit
                if hit is None:
                    timeline.choose()
                elif not io.key_ctrl:
                    self._choose(hit)
        if self._grabbed is None or not imgui.is_item_deactivated():
            return
        frames, hit, self._grabbed = self._shift, self._grabbed, None
        if frames:
            if hit not in timeline.chosen:
                timeline.choose(hit)
            timeline.shift(frames, copy=io.key_ctrl)
        elif io.key_ctrl:
            timeline.toggle(hit)

    def _choose(self, key: Chosen) -> None:
        if key not in self._ui.timeline.chosen:
            self._ui.timeline.choose(key)

    def _hit(self, row: Row) -> Chosen | None:
        """Return the key of a row at the mouse."""
        x, reach = imgui.get_io().mouse_pos.x, REACH_EM * imgui.get_font_size()
        near = [(abs(self.places[key][0] - x), key) for key in map(row.key, _times(row))]
        return min((pair for pair in near if pair[0] <= reach), default=(0.0, None))[1]

    @property
    def _shift(self) -> int:
        """Frames by which the grabbed key is dragged."""
        if self._grabbed is None or abs(imgui.get_mouse_drag_delta(0, 0.0).x) < DRAG_PX:
            return 0
        timeline, axis = self._ui.timeline, self._axis
        x = self.places.get(self._grabbed, (0.0, 0.0))[0] + imgui.get_mouse_drag_delta(0, 0.0).x
        frame = round(axis.first + (x - axis.left) / axis.width * (axis.last - axis.first))
        frame = max(frame, axis.first)
        return frame - round(timeline.frame_of(self._grabbed[2]))

    def _diamonds(self, row: Row, radius: float, draw: imgui.ImDrawList) -> None:
        chosen, shift = self._ui.timeline.chosen, self._shift
        dragged = {self._grabbed} if self._grabbed not in chosen else chosen
        per_frame = self._axis.width / (self._axis.last - self._axis.first)
        for key in map(row.key, _times(row)):
            x, y = self.places[key]
            color = packed(ACCENT if key in chosen else TEXT)
            if shift and key in dragged:
                copy = imgui.get_io().key_ctrl
                _diamond(draw, x, y, radius, packed(QUIET), filled=copy)
                x, color = x + shift * per_frame, packed(ACCENT)
            _diamond(draw, x, y, radius, color, filled=True)

    def _menu(self) -> None:
        """Draw the list of interpolations beside the key that was clicked."""
        if not imgui.begin_popup("key"):
            return
        _, _, interpolation = key_fields(self._ui)
        now = {
            key.interpolation
            for row in self._ui.timeline.rows
            for key in row.keys
            if row.key(key.time) in self._ui.timeline.chosen
        }
        for value, label in interpolation.options().items():
            if imgui.selectable(label.name, now == {value})[0]:
                interpolation.write(value)
        imgui.separator()
        delete = timeline_actions(self._ui)["delete keys"]
        if imgui.selectable(f"{delete.label.name} ({delete.keys})", False)[0]:
            delete.act()
        imgui.end_popup()


def _times(row: Row) -> list[float]:
    return [key.time for key in row.keys]


def _diamond(
    draw: imgui.ImDrawList, x: float, y: float, radius: float, color: int, *, filled: bool
) -> None:
    top, right, bottom, left = (
        imgui.ImVec2(x + dx * radius, y + dy * radius) for dx, dy in _CORNERS
    )
    (draw.add_quad_filled if filled else draw.add_quad)(top, right, bottom, left, color)


_CORNERS = ((0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0))


def _round_step(step: float) -> int:
    """Return the least of 1, 2, 5, 10, 20, ... that is not below a step."""
    for factor in (10**power for power in range(7)):
        for digit in (1, 2, 5):
            if digit * factor >= step:
                return int(digit * factor)
    return 10**7
