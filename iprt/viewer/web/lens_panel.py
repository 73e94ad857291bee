"""How the picture is shown: exposure, tone curve, buffers, comparisons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from iprt.viewer.labels import AGAINST, BUFFERS, CURVES, NOTHING, PARTS, PICTURE, Label
from iprt.viewer.web.binding import Binding, Choice, show
from iprt.viewer.web.browser_api import BrowserApi


class LensPanel:
    """This window's own; its thread uses it."""

    def __init__(self, browser: BrowserApi) -> None:
        self._browser = browser
        gui = browser.client.gui
        self._bindings: list[Binding] = []
        part = PARTS["exposure"]
        self._bind(gui.add_slider(part.name, -8.0, 8.0, 0.1, 0.0, hint=part.about), "exposure_ev")
        self._choose("curve", CURVES)
        self._choose("buffer", {None: PICTURE, **BUFFERS})
        self._choose("against", {None: NOTHING, **AGAINST})
        split, error = PARTS["split"], PARTS["error"]
        self._compared = (
            gui.add_slider(split.name, 0.0, 1.0, 0.01, 0.5, hint=split.about),
            gui.add_checkbox(error.name, False, hint=error.about),
        )
        self._bind(self._compared[0], "split")
        self._bind(self._compared[1], "error")
        gui.add_markdown("Click into the picture to read out a pixel, in linear units.")

    def _bind(self, handle: Any, part: str) -> None:
        """An input to a part of the lens."""
        browser = self._browser
        self._bindings.append(
            Binding(handle, self._reader(part), self._writer(part), browser.post, browser.tell)
        )

    def _choose(self, part: str, options: Mapping[Any, Label]) -> None:
        """A dropdown for a part of the lens."""
        browser = self._browser
        self._bindings.append(
            Choice(
                browser.client.gui,
                PARTS[part],
                options,
                self._reader(part),
                self._writer(part),
                browser.post,
                browser.tell,
            )
        )

    def _reader(self, part: str) -> Any:
        return lambda: getattr(self._browser.viewport.lens, part)

    def _writer(self, part: str) -> Any:
        def write(value: Any) -> None:
            change: dict[str, Any] = {part: value}
            self._browser.viewport.lens = replace(self._browser.viewport.lens, **change)

        return write

    def sync(self) -> None:
        lens = self._browser.viewport.lens
        split, error = self._compared
        show(split, "disabled", lens.against is None or lens.error)
        show(error, "disabled", lens.against is None)
        for binding in self._bindings:
            binding.sync()
