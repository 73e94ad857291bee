"""The desktop viewer and its frame loop."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from imgui_bundle import imgui

from iprt.viewer.desktop import bars, panels, profile_panel, render_panel, settings_panel
from iprt.viewer.desktop.dialogs import MeshBrowser, draw_help, draw_leaving, draw_offer
from iprt.viewer.desktop.picture_view import PictureView
from iprt.viewer.desktop.shortcuts import act_on_keys
from iprt.viewer.desktop.timeline import TimelineStrip
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.window import KeyPress, Window
from iprt.viewer.engine import Engine
from iprt.viewer.render_fields import TAB
from iprt.viewer.viewport import Viewport
from iprt.viewer.windows import Start, Windows

PANEL_WIDTH = 360.0
"""Width of the panel on the right, in units of 1/96 inch like all drawing."""
TAB_PADDING = 0.6
"""Space beside the name of a tab, as a fraction of the frame of buttons."""
SETTLING = 2
"""Frames until windows have adapted to the size of new texts."""
BUSY_S, IDLE_S = 0.01, 0.1
"""Longest waits for events in seconds, while the engine works and while it rests."""

_PANEL = (
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_bring_to_front_on_focus
    | imgui.WindowFlags_.no_nav
)
_TABS: tuple[tuple[str, Callable[[DesktopState], None]], ...] = (
    ("Scene", panels.scene),
    ("Light", panels.light),
    ("Picture", panels.picture),
    ("Settings", settings_panel.draw),
    ("Profile", profile_panel.draw),
    (TAB.name, render_panel.draw),
)


class App(Windows):
    """The viewer in its window, which never waits for the device.

    Parameters
    ----------
    engine : Engine
    viewport : Viewport
        Its view has the window's initial size, in screen units.

    Raises
    ------
    DeviceError
        No window can be opened.
    """

    def __init__(self, engine: Engine, viewport: Viewport) -> None:
        self._engine, view = engine, viewport.view
        self.window = Window(engine.scene.name, (view.width, view.height), self._drop)
        self.ui = DesktopState(engine, viewport)
        self.picture_view = PictureView(self.ui, self.window)
        self.timeline = TimelineStrip(self.ui)
        self._browser = MeshBrowser(Path.cwd())
        self._dropped: list[Path] = []
        self._drawn: tuple[object, ...] = ()
        self._unsettled = 0
        self._discarding = False

    @property
    def start(self) -> Start:
        """The window's present state, because no other window follows."""
        return Start.of(self.ui.viewport)

    def begin(self, start: Start) -> None:
        """Do nothing, because no other window follows."""

    @property
    def states(self) -> tuple[DesktopState]:
        """The window's state."""
        return (self.ui,)

    def leave(self) -> None:
        """Close the window soon, and discard unsaved edits."""
        self.ui.post("leave", self._discard)

    def _discard(self) -> None:
        self._engine.autosaver.abandon()
        self._discarding = self.window.closing = True

    def close(self) -> None:
        """Close the window; the engine stays open."""
        self.ui.viewport.close()
        self.window.close()

    @property
    def closed(self) -> bool:
        """True if the user closed the window and loses nothing, or has agreed to that."""
        engine = self.ui.engine
        lossy = engine.unsaved or engine.renders.open
        if self.window.closing and lossy and not self._discarding:
            self.window.closing = False
            self.ui.leaving = True
        return self.window.closing

    def run(self) -> None:
        """Run until the window is closed."""
        while not self.closed:
            self.step()

    def step(self) -> None:
        """Wait briefly for events or a new picture, and draw."""
        ui, status = self.ui, self._engine.status
        busy = status.doing != "waiting" or ui.playing
        stirred = self.window.wait(BUSY_S if busy else IDLE_S)
        displayed, status = ui.viewport.poll(), self._engine.status
        if displayed is not ui.displayed and displayed is not None:
            self.window.upload(displayed.pixels)
            ui.pass_times.add(displayed.shown)
        ui.displayed = displayed
        ui.run_posted()
        if ui.closing and not ui.engine.unsaved:
            ui.engine.renders.cancel_all()
            self.window.closing, ui.closing = True, False
        # The view counts too: drags change it during drawing, too late for the parts above.
        renders, offer = ui.engine.renders.renders, ui.engine.autosaver.offer
        new = (displayed, status, ui.notice, ui.leaving, ui.viewport.view, renders, offer)
        if new != self._drawn:
            self._drawn, self._unsettled = new, SETTLING
        typing = imgui.get_io().want_text_input  # its cursor blinks
        if stirred or typing or self._unsettled:
            self._unsettled = max(self._unsettled - 1, 0)
            with self.window.frame():
                self._draw()

    def _drop(self, files: list[Path]) -> None:
        self._dropped += files

    def _draw(self) -> None:
        ui = self.ui
        self.window.rename(f"{ui.engine.scene.name}{' *' if ui.engine.unsaved else ''} - iprt")
        presses = self.window.take_keys()
        if KeyPress("F11", repeated=False) in presses:
            self.window.switch_full_screen()
        act_on_keys(ui, presses)
        width, height = imgui.get_io().display_size
        panel = round(PANEL_WIDTH * self.window.scale)
        panel = panel if ui.panels and width > 1.5 * panel else 0
        line = round(imgui.get_frame_height() + 2.0 * imgui.get_style().item_spacing.y)
        bars_height = (line if len(ui.frames) > 1 else 0) + line
        bars_height = bars_height if height > 2 * bars_height else 0
        keys_height = round(self.timeline.height)
        keys_height = keys_height if height > 2 * (keys_height + bars_height) else 0
        top = height - bars_height - keys_height
        self.picture_view.draw((0.0, 0.0, width - panel, top))
        if self._dropped:
            dropped, self._dropped = self._dropped, []
            ui.add_all(dropped)
        if keys_height:
            self.timeline.draw((0.0, top, width - panel, keys_height), _PANEL)
        if bars_height:
            self._draw_bars(height - bars_height, width - panel, bars_height)
        if panel:
            self._draw_panel(width - panel, panel, height)
        draw_help(ui)
        self._browser.draw(ui)
        draw_offer(ui)
        if draw_leaving(ui):
            self._discard()

    def _draw_panel(self, left: float, width: float, height: float) -> None:
        imgui.set_next_window_pos(imgui.ImVec2(left, 0.0))
        imgui.set_next_window_size(imgui.ImVec2(width, height))
        imgui.begin("panels", None, _PANEL)
        padding, across = imgui.StyleVar_.frame_padding, imgui.get_style().frame_padding.x
        down = imgui.get_style().frame_padding.y
        # So that all tabs fit beside each other.
        imgui.push_style_var(padding, imgui.ImVec2(TAB_PADDING * across, down))
        if imgui.begin_tab_bar("tabs"):
            for name, draw in _TABS:
                flags = imgui.TabItemFlags_.set_selected if name == self.ui.tab else 0
                if imgui.begin_tab_item(name, None, flags)[0]:
                    imgui.push_style_var(padding, imgui.ImVec2(across, down))
                    imgui.begin_child("content", imgui.ImVec2(0.0, 0.0))
                    draw(self.ui)
                    imgui.end_child()
                    imgui.pop_style_var()
                    imgui.end_tab_item()
            imgui.end_tab_bar()
            self.ui.tab = None
        imgui.pop_style_var()
        imgui.end()

    def _draw_bars(self, top: float, width: float, height: float) -> None:
        imgui.set_next_window_pos(imgui.ImVec2(0.0, top))
        imgui.set_next_window_size(imgui.ImVec2(width, height))
        padding = imgui.ImVec2(imgui.get_style().window_padding.x, imgui.get_style().item_spacing.y)
        imgui.push_style_var(imgui.StyleVar_.window_padding, padding)
        imgui.begin("bars", None, _PANEL)
        if len(self.ui.frames) > 1:
            bars.playback(self.ui)
        imgui.align_text_to_frame_padding()
        bars.status(self.ui)
        imgui.end()
        imgui.pop_style_var()
