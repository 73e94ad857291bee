"""The panels beside the picture: folders or tabs, with the status above them."""

from __future__ import annotations

from html import escape
from typing import Protocol

from iprt.viewer.displayed_frame import DisplayedFrame
from iprt.viewer.fields import lens_fields
from iprt.viewer.labels import PICTURE
from iprt.viewer.web.binding import show
from iprt.viewer.web.browser_state import BrowserState
from iprt.viewer.web.files_panel import FilesPanel
from iprt.viewer.web.inputs import Inputs
from iprt.viewer.web.object_panel import ObjectPanel
from iprt.viewer.web.profile_panel import ProfilePanel
from iprt.viewer.web.scene_panel import ScenePanel
from iprt.viewer.web.settings_panel import SettingsPanel
from iprt.viewer.web.visible_panel import VisiblePanel

WIDTH_PX = 340
LINES, LINE_EM = 8, 1.5
"""Height of the status panel."""


class Panel(Protocol):
    """A part of the interface."""

    def sync(self) -> None:
        """Show changed values."""


class Panels:
    """All panels of one browser, for use by the window's thread."""

    def __init__(self, browser: BrowserState) -> None:
        gui = browser.client.gui
        gui.set_panel_label(f"iprt  ·  {browser.engine.scene.name}")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH_PX)
        self._status = Status(browser)
        tabs = gui.add_tab_group()
        self._panels: list[Panel] = [self._status]
        with tabs.add_tab("Scene"):
            self._panels += [ScenePanel(browser), FilesPanel(browser)]
            self._panels += [VisiblePanel(browser), ObjectPanel(browser)]
        with tabs.add_tab(PICTURE.name):
            self._panels.append(Inputs(browser, lens_fields(browser)))
            gui.add_markdown("Click into the picture to read out a pixel, in linear units.")
        with tabs.add_tab("Settings"):
            self._panels.append(SettingsPanel(browser))
        with tabs.add_tab("Profile"):
            self._panels.append(ProfilePanel(browser))

    def sync(self) -> None:
        """Show changed values in all panels."""
        for panel in self._panels:
            panel.sync()


class Status:
    """The status panel: picture, quality, activity and problems.

    Its height is fixed, so that the parts below stay in place. Long lines are cut off, with the
    full text as a tooltip. More lines are reached by scrolling.
    """

    def __init__(self, browser: BrowserState) -> None:
        self._browser = browser
        self._html = browser.client.gui.add_html("")

    def sync(self) -> None:
        """Show the current status."""
        show(self._html, "content", self._content())

    def _content(self) -> str:
        browser = self._browser
        status, displayed = browser.engine.status, browser.displayed
        lines = [_line("state", status.text)]
        lines += [_news("problem", "#ff8787", problem) for problem in status.problems]
        if displayed is not None and displayed.warning:
            lines.append(_news("warning", "#ffc078", displayed.warning))
        lines += [_news("note", "#74c0fc", note) for note in status.notes]
        if displayed is not None:
            lines += self._picture(displayed)
        if browser.read is not None:
            (_, place), *values = browser.read.rows()
            text = "; ".join([place, *(f"{name} {value}" for name, value in values)])
            lines.append(_line("pixel", text, lines=3))
        style = (
            f"height:{LINES * LINE_EM}em;overflow-y:auto;box-sizing:content-box;font-size:.8em;"
            f"line-height:{LINE_EM}em;padding:.4em .6em;overflow-wrap:anywhere"
        )
        return f"<div class='status' style='{style}'>{''.join(lines)}</div>"

    def _picture(self, displayed: DisplayedFrame) -> list[str]:
        browser, shown = self._browser, displayed.shown
        view = shown.request.view
        sent = "lossless" if browser.lossless else "JPEG"
        lines = []
        if displayed.preview is None:
            lines.append(_line("picture", f"{view.width} × {view.height}, {sent}"))
        else:
            about = f"{view.width} × {view.height}, {sent}. {displayed.preview.details}"
            lines.append(_line("picture", displayed.preview.short, about))
        if shown.plain:
            lines.append(_line("shows", "the video; objects follow"))
        else:
            noise = "" if shown.noise is None else f", noise {100 * shown.noise:.2g} %"
            lines.append(_line("frames", f"{shown.frames} of {shown.request.frames}{noise}"))
        speed = []
        if displayed.fps is not None:
            speed.append(f"{displayed.fps:.1f} per second")
        if displayed.latency_s is not None:
            speed.append(f"{1000 * displayed.latency_s:.0f} ms from input to picture")
        if speed:
            lines.append(_line("speed", ", ".join(speed)))
        if displayed.caption:
            lines.append(_line("shows", displayed.caption))
        return lines


def _line(name: str, text: str, about: str = "", *, lines: int = 1) -> str:
    """Return a name with at most `lines` lines of text, and a tooltip."""
    cut = (
        "display:-webkit-box;-webkit-box-orient:vertical;overflow:hidden;"
        f"-webkit-line-clamp:{lines}"
    )
    return (
        f"<div style='display:flex;gap:.6em' title='{escape(about or text)}'>"
        f"<span style='opacity:.6;width:5em;flex:none'>{name}</span>"
        f"<span class='{name}' style='{cut}'>{escape(text)}</span></div>"
    )


def _news(kind: str, color: str, text: str) -> str:
    return f"<div class='{kind}' style='color:{color}'>{escape(text)}</div>"
