"""The panels beside the picture: one folder or tab each, and the status above them."""

from __future__ import annotations

import time
from collections import deque
from html import escape
from typing import TYPE_CHECKING, Protocol

from iprt.viewer.web.lens_panel import LensPanel
from iprt.viewer.web.object_panel import ObjectPanel
from iprt.viewer.web.profile_panel import ProfilePanel
from iprt.viewer.web.scene_panel import ScenePanel
from iprt.viewer.web.settings_panel import SettingsPanel

if TYPE_CHECKING:
    from iprt.viewer.web.browser import Browser

WIDTH_PX = 340
_DOING = {
    "loading": "loads {}",
    "compiling": "compiles {}",
    "rendering": "refines",
    "waiting": "at rest",
    "closed": "has ended",
}


class Panel(Protocol):
    """A part of the interface."""

    def sync(self) -> None:
        """Show what has changed."""


class Panels:
    """All of one browser. Of the window's thread."""

    def __init__(self, browser: Browser) -> None:
        gui = browser.client.gui
        gui.set_panel_label(f"iprt  ·  {browser.engine.scene.name}")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH_PX)
        self._status = Status(browser)
        tabs = gui.add_tab_group()
        self._panels: list[Panel] = [self._status]
        with tabs.add_tab("Scene"):
            self._panels += [ScenePanel(browser), ObjectPanel(browser)]
        with tabs.add_tab("Lens"):
            self._panels.append(LensPanel(browser))
        with tabs.add_tab("Settings"):
            self._panels.append(SettingsPanel(browser))
        with tabs.add_tab("Profile"):
            self._panels.append(ProfilePanel(browser))

    def sync(self) -> None:
        for panel in self._panels:
            panel.sync()


class Status:
    """What is shown, how good it is, what goes on, and what went wrong."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        self._html = browser.client.gui.add_html("")
        self._steps: deque[tuple[float, int]] = deque(maxlen=20)

    def sync(self) -> None:
        content = self._content()
        if content != self._html.content:
            self._html.content = content

    def _content(self) -> str:
        browser = self._browser
        status, sight = browser.engine.status, browser.sight
        doing = _DOING[status.doing].format(status.what)
        rows = [("engine", doing)]
        if sight is not None:
            shown = sight.shown
            view, pane = shown.request.view, browser.viewport.view
            share = round(100 * view.width / pane.width)
            sent = "lossless" if browser.lossless else "JPEG"
            rows.append(("picture", f"{view.width} × {view.height}, {share} %, {sent}"))
            noise = "" if shown.noise is None else f", noise {100 * shown.noise:.2g} %"
            rows.append(("frames", f"{shown.frames} of {shown.request.frames}{noise}"))
            rows.append(
                ("speed", f"{1000 * shown.seconds:.0f} ms per frame{self._rate(shown.step)}")
            )
            if sight.gave_up:
                rows.append(("gave up", sight.gave_up))
            if sight.latency_s is not None:
                frames = sight.latency_frames
                text = f"{1000 * sight.latency_s:.0f} ms, {frames} frame{'s' * (frames != 1)}"
                rows.append(("latency", text))
            if sight.caption:
                rows.append(("compared", sight.caption))
        if browser.read is not None:
            rows.append(("pixel", browser.read))
        lines = "".join(
            f"<div style='display:flex;gap:.6em'><span style='opacity:.55;width:5em;flex:none'>"
            f"{name}</span><span>{escape(text)}</span></div>"
            for name, text in rows
        )
        problems = "".join(
            f"<div class='problem' style='color:#ff6b6b;padding-top:.3em'>{escape(problem)}</div>"
            for problem in status.problems
        )
        style = "font-size:.8em;line-height:1.5;padding:.4em .6em;overflow-wrap:anywhere"
        return f"<div class='status' style='{style}'>{lines}{problems}</div>"

    def _rate(self, step: int) -> str:
        """View frames per second, of late."""
        now = time.monotonic()
        if not self._steps or self._steps[-1][1] != step:
            self._steps.append((now, step))
        (first_s, first), (last_s, last) = self._steps[0], self._steps[-1]
        if now - last_s > 1.0 or last_s <= first_s:
            return ""
        return f", {(last - first) / (last_s - first_s):.1f} per second"
