"""Dialogs: the mesh browser, the list of keys, and the question before closing."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.errors import IprtError
from iprt.geometry.mesh_files import MESH_SUFFIXES
from iprt.viewer.actions import offer_actions
from iprt.viewer.desktop.shortcuts import ELSEWHERE, shortcuts
from iprt.viewer.desktop.style import ACCENT, BAD, QUIET
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.widgets import button, quiet
from iprt.viewer.labels import PARTS
from iprt.viewer.ui_state import MIDDLE

_FIXED = (
    imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_collapse
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.always_auto_resize
)


COLUMN_EM, MOST_COLUMNS = 30.0, 3
"""Least width of a column of the help, and the largest number of columns."""


def draw_help(ui: DesktopState) -> None:
    """Draw the help on keys and mouse."""
    if not ui.help:
        return
    _centre()
    unfolded, opened = imgui.begin("Keys and mouse", True, _FIXED)
    ui.help = bool(opened)
    if unfolded:
        keys = [(a.keys, a.label.name[0].lower() + a.label.name[1:]) for a in shortcuts(ui)]
        rows = [*ELSEWHERE, *keys]
        em, room = imgui.get_font_size(), imgui.get_main_viewport().size.x
        columns = max(1, min(MOST_COLUMNS, int(room / (COLUMN_EM * em))))
        height = -(-len(rows) // columns)
        flags = imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.pad_outer_x
        if imgui.begin_table("keys", 2 * columns, flags):
            for place in range(height * columns):
                line = place // columns + (place % columns) * height
                key, about = rows[line] if line < len(rows) else ("", "")
                imgui.table_next_column()
                imgui.text_colored(imgui.ImVec4(*ACCENT), key)
                imgui.table_next_column()
                imgui.text_unformatted(f"{about}   ")
            imgui.end_table()
    imgui.end()


def draw_leaving(ui: DesktopState) -> bool:
    """Ask before the window closes with unsaved edits or renders; return True if it may close."""
    if not ui.leaving:
        return False
    leave, unsaved, renders = False, ui.engine.unsaved, ui.engine.renders.open
    if not (unsaved or renders):  # the renders have ended meanwhile
        return True
    _centre()
    imgui.begin("Unsaved edits" if unsaved else "Unfinished renders", None, _FIXED)
    if unsaved:
        imgui.text_unformatted(f"{ui.engine.scene.name} has edits that its file does not have.")
        quiet("They are lost when the window closes.", wrap_em=30.0)
    if renders:
        imgui.text_unformatted(f"Not rendered to the end: {', '.join(renders)}.")
        quiet("Closing cancels that. Finished frames of videos stay.", wrap_em=30.0)
    imgui.spacing()
    if unsaved:
        if button("Save and close"):
            ui.save()
            ui.leaving = False
            ui.closing = True
        imgui.same_line()
    if button("Close without saving" if unsaved else "Cancel and close"):
        leave = True
    imgui.same_line()
    if button("Stay"):
        ui.leaving = False
    imgui.end()
    return leave


def draw_offer(ui: DesktopState) -> None:
    """Ask what becomes of the unsaved edits of an earlier viewer."""
    offer = ui.engine.autosaver.offer
    if offer is None or ui.leaving:
        return
    _centre()
    imgui.begin(PARTS["offer"].name, None, _FIXED)
    imgui.push_text_wrap_pos(30.0 * imgui.get_font_size())
    imgui.text_unformatted(offer.text)
    imgui.pop_text_wrap_pos()
    quiet(PARTS["offer"].about, wrap_em=30.0)
    imgui.spacing()
    for action in offer_actions(ui):
        if button(action.label.name, action.hint):
            action.act()
        imgui.same_line()
    imgui.end()


def _centre() -> None:
    middle = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(middle, imgui.Cond_.appearing, imgui.ImVec2(0.5, 0.5))


class MeshBrowser:
    """A browser of folders and mesh files, drawn by the viewer itself.

    It needs no file dialog of the desktop, locally or over a network.

    Parameters
    ----------
    folder : Path
        Initial folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder.resolve()
        self._text = str(self._folder)
        self._problem = ""
        self._open = False

    def draw(self, ui: DesktopState) -> None:
        """Draw the browser while `ui.browsing`."""
        if not ui.browsing:
            self._open, self._problem = False, ""
            return
        em = imgui.get_font_size()
        _centre()
        imgui.set_next_window_size(imgui.ImVec2(34 * em, 26 * em), imgui.Cond_.appearing)
        flags = imgui.WindowFlags_.no_collapse | imgui.WindowFlags_.no_saved_settings
        unfolded, opened = imgui.begin("Add a mesh", True, flags)
        ui.browsing = bool(opened)
        if unfolded:
            chosen = self._path()
            if self._problem:
                imgui.push_text_wrap_pos(0.0)
                imgui.text_colored(imgui.ImVec4(*BAD), self._problem)
                imgui.pop_text_wrap_pos()
            imgui.begin_child("files", imgui.ImVec2(0, -1.4 * imgui.get_frame_height()))
            chosen = self._list() or chosen
            imgui.end_child()
            quiet("It is set down in the middle of the picture; or drop files on the picture.")
            if chosen is not None:
                self._add(ui, chosen)
        imgui.end()
        if imgui.is_key_pressed(imgui.Key.escape):  # also during text input
            ui.browsing = False

    def _add(self, ui: DesktopState, path: Path) -> None:
        """Add a mesh to the middle of the picture; stay open if it cannot be."""
        try:
            ui.add(path, *MIDDLE)
        except IprtError as error:
            self._problem = str(error)
        else:
            ui.browsing = False

    def _path(self) -> Path | None:
        """Draw the text field for a path; return the file that was entered."""
        imgui.set_next_item_width(-1.0)
        if not self._open:
            imgui.set_keyboard_focus_here()
            self._open = True
        entered, self._text = imgui.input_text(
            "##path", self._text, imgui.InputTextFlags_.enter_returns_true
        )
        if not entered:
            return None
        path = Path(self._text).expanduser()
        if path.is_dir():
            self._go_to(path)
            return None
        return path

    def _list(self) -> Path | None:
        """Draw folders and meshes; return the file that was clicked."""
        if imgui.selectable(f"{icons.ICON_FA_FOLDER_OPEN}  ..", False)[0]:
            self._go_to(self._folder.parent)
        try:
            entries = sorted(self._folder.iterdir(), key=lambda path: path.name.lower())
            folders = [path for path in entries if path.is_dir() and path.name[0] != "."]
        except OSError as error:
            imgui.text_colored(imgui.ImVec4(*BAD), f"{self._folder}: {error.strerror}")
            return None
        for path in folders:
            if imgui.selectable(f"{icons.ICON_FA_FOLDER}  {path.name}", False)[0]:
                self._go_to(path)
        chosen = None
        for path in entries:
            if path.suffix.lower() in MESH_SUFFIXES and not path.is_dir():
                if imgui.selectable(f"{icons.ICON_FA_CUBE}  {path.name}", False)[0]:
                    chosen = path
                imgui.same_line()
                imgui.text_colored(imgui.ImVec4(*QUIET), f"  {_size(path)}")
        return chosen

    def _go_to(self, folder: Path) -> None:
        self._folder = folder.resolve()
        self._text = str(self._folder)


def _size(path: Path) -> str:
    try:
        size = path.stat().st_size
    except OSError:
        return ""
    return f"{size / 1e6:.1f} MB" if size >= 1e5 else f"{size / 1e3:.1f} kB"
