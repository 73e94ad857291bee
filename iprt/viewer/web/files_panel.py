"""The panel of undo and redo, the scene's file, and pictures as files."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from iprt.viewer.labels import PARTS
from iprt.viewer.web.binding import do_on, show
from iprt.viewer.web.browser_state import BrowserState

QUIET = (60, 66, 74)
"""Button colour (RGB)."""


class FilesPanel:
    """The files panel, for use by the window's thread; all browsers share edits."""

    def __init__(self, browser: BrowserState) -> None:
        self._browser, engine = browser, browser.engine
        gui, post = browser.client.gui, browser.post
        buttons = (
            ("undo", "arrow-back-up", "Ctrl+Z", engine.undo),
            ("redo", "arrow-forward-up", "Ctrl+Shift+Z", engine.redo),
        )
        self._undo, self._redo = (
            gui.add_button(
                PARTS[part].name,
                icon=icon,
                color=QUIET,
                disabled=True,
                hint=f"{PARTS[part].about} Key: {key}.",
            )
            for part, icon, key, _ in buttons
        )
        for button, (_, _, _, do) in zip((self._undo, self._redo), buttons, strict=True):
            do_on(button.on_click, post, do)
        keys = (("Undo", "cmd/ctrl", engine.undo), ("Redo", "cmd/ctrl+shift", engine.redo))
        for label, modifier, do in keys:
            do_on(gui.add_command(label, hotkey="Z", modifier=modifier).on_trigger, post, do)
        save, screenshot = PARTS["save"], PARTS["screenshot"]
        self._save = gui.add_button(save.name, icon="device-floppy", disabled=True, hint=save.about)
        do_on(self._save.on_click, post, self._save_scene)
        pictures = gui.add_button_group(screenshot.name, ("PNG", "EXR"), hint=screenshot.about)

        async def wanted(event: Any) -> None:
            suffix = f".{event.target.value.lower()}"
            post(object(), lambda: self._send_picture(suffix))

        pictures.on_click(wanted)

    def _save_scene(self) -> None:
        browser = self._browser

        def done(problem: str | None) -> None:
            if problem is None:
                path = browser.engine.scene.root / "scene.toml"
                browser.post("saved", lambda: browser.say(f"saved to {path}"))
            else:
                browser.post("saved", lambda: browser.say(problem, bad=True))

        browser.viewport.save(done)

    def _send_picture(self, suffix: str) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = self._browser.viewport.screenshot(suffix, Path(folder))
            self._browser.client.send_file_download(
                path.name, path.read_bytes(), save_immediately=True
            )

    def sync(self) -> None:
        """Update the buttons."""
        engine = self._browser.engine
        show(self._undo, "disabled", not engine.can_undo)
        show(self._redo, "disabled", not engine.can_redo)
        show(self._save, "disabled", not engine.unsaved)
