"""How the picture is shown: exposure, tone curve, buffers, comparisons."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, get_args

from iprt.viewer.lens import BUFFERS, Against
from iprt.viewer.tone import Curve
from iprt.viewer.web.binding import Binding

if TYPE_CHECKING:
    from iprt.viewer.web.browser import Browser

PICTURE, NOTHING = "picture", "nothing"


class LensPanel:
    """This window's own. Of its thread."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        gui = browser.client.gui
        self._bindings: list[Binding] = []
        self._bind(
            gui.add_slider("Exposure", -8.0, 8.0, 0.1, 0.0, hint="Stops on top of the scene's"),
            "exposure_ev",
        )
        curves = get_args(Curve)
        self._bind(
            gui.add_dropdown("Tone curve", curves, hint="srgb: as PNG files are written"), "curve"
        )
        self._bind(
            gui.add_dropdown("Show", (PICTURE, *BUFFERS), hint="Or an intermediate buffer"),
            "buffer",
            PICTURE,
        )
        against = gui.add_dropdown(
            "Compare with",
            (NOTHING, *get_args(Against)),
            hint="The video without objects, the usual baseline, or the path-traced truth",
        )
        self._bind(against, "against", NOTHING)
        self._compared = (
            gui.add_slider("Split", 0.0, 1.0, 0.01, 0.5, hint="Left of it: ours"),
            gui.add_checkbox("Error map", False, hint="Where and how much the two differ"),
        )
        self._bind(self._compared[0], "split")
        self._bind(self._compared[1], "error")
        gui.add_markdown("Click into the picture to read out a pixel, in linear units.")

    def _bind(self, handle: Any, part: str, nothing: str | None = None) -> None:
        """An input to a part of the lens; `nothing` stands for None."""
        browser = self._browser

        def read() -> Any:
            value = getattr(browser.viewport.lens, part)
            return nothing if value is None else value

        def write(value: Any) -> None:
            change: dict[str, Any] = {part: None if value == nothing else value}
            browser.viewport.lens = replace(browser.viewport.lens, **change)

        self._bindings.append(Binding(handle, read, write, browser.post, browser.tell))

    def sync(self) -> None:
        compared = self._browser.viewport.lens.against is not None
        for handle in self._compared:
            if handle.disabled == compared:
                handle.disabled = not compared
        for binding in self._bindings:
            binding.sync()
