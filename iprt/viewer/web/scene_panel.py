"""Which view, which frame of the video, and the scene's file."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from iprt.viewer.web.binding import Binding, on_click, on_trigger

if TYPE_CHECKING:
    from iprt.viewer.web.browser import Browser

FREE = "free"
"""In place of a view's name: it was turned."""


class ScenePanel:
    """Views, playback, files. Of the window's thread."""

    def __init__(self, browser: Browser) -> None:
        self._browser, engine = browser, browser.engine
        gui, post = browser.client.gui, browser.post
        self._bindings: list[Binding] = []
        scene = engine.scene
        self._names = tuple(scene.views)
        self._views = gui.add_dropdown("View", (FREE, *self._names), hint="The scene's own views")
        self._bind(self._views, lambda: browser.viewport.name or FREE, self._go_to)
        everything = gui.add_checkbox(
            "All objects", False, hint="Else those that the view is meant to show"
        )
        self._bind(everything, lambda: browser.viewport.objects is None, self._show_all)
        self._frames = scene.frame_indices
        if len(self._frames) > 1:
            self._add_playback()
        files = gui.add_button_group("Picture", ("PNG", "EXR"), hint="Save what you see")

        async def wanted(event: Any) -> None:
            suffix = event.target.value.lower()
            post(object(), lambda: self._save_picture(suffix))

        files.on_click(wanted)
        save = gui.add_button(
            "Save the scene", icon="device-floppy", hint="Into scene.toml; comments stay"
        )
        on_click(save, post, self._save)

    def _bind(self, handle: Any, read: Any, write: Any) -> None:
        browser = self._browser
        self._bindings.append(Binding(handle, read, write, browser.post, browser.tell))

    def _add_playback(self) -> None:
        browser, frames = self._browser, self._frames
        gui, engine = browser.client.gui, browser.engine
        first, last = frames[0], frames[-1]
        self._slider = gui.add_slider("Frame", first, last, 1, first, hint="As scene.toml counts")
        self._bind(self._slider, self._frame, lambda frame: engine.seek(int(frame)))
        playing = gui.add_checkbox("Play", False)
        self._bind(
            playing,
            lambda: engine.world.playback.since_s is not None,
            lambda play: engine.play() if play else engine.pause(),
        )
        on_trigger(gui.add_command("Play or pause", hotkey="space"), browser.post, self._toggle)

    def _toggle(self) -> None:
        engine = self._browser.engine
        playing = engine.world.playback.since_s is not None
        (engine.pause if playing else engine.play)()

    def _frame(self) -> int:
        """That is asked for, or in a video that plays, the one that is seen."""
        playback, sight = self._browser.engine.world.playback, self._browser.sight
        if playback.since_s is not None and sight is not None:
            return sight.shown.frame
        return playback.frame

    def _go_to(self, name: str) -> None:
        if name in self._browser.engine.scene.views:
            self._browser.go_to(name)

    def _show_all(self, everything: bool) -> None:
        viewport = self._browser.viewport
        views = self._browser.engine.scene.views
        own = None if viewport.name is None else views[viewport.name].objects
        viewport.show_objects(None if everything else own)

    def _save(self) -> None:
        browser, engine = self._browser, self._browser.engine
        if not engine.world.edits:
            browser.say("nothing to save")

        def done(problem: str | None) -> None:
            if problem is None:
                path = engine.scene.root / "scene.toml"
                browser.post("saved", lambda: browser.say(f"saved to {path}"))
            else:
                browser.post("saved", lambda: browser.tell(problem))

        engine.save(done)

    def _save_picture(self, suffix: str) -> None:
        browser = self._browser
        name = f"{browser.engine.scene.name}.{suffix}"
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / name
            browser.viewport.screenshot(path)
            browser.client.send_file_download(name, path.read_bytes(), save_immediately=True)

    def sync(self) -> None:
        names = tuple(self._browser.engine.scene.views)
        if names != self._names:
            self._names = names
            self._views.options = (FREE, *names)
        for binding in self._bindings:
            binding.sync()
