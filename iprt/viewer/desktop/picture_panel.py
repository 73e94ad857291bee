"""The panel of the picture: the lens that it is seen through, comparisons, screenshots."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.viewer.desktop.desk import Desk
from iprt.viewer.desktop.widgets import button, choice, disabled, heading, label, quiet
from iprt.viewer.lens import BUFFERS, Against, Lens
from iprt.viewer.tone import Curve

MOST_EV = 8.0
CURVES: tuple[Curve, ...] = get_args(Curve)
AGAINST: tuple[Against | None, ...] = (None, *get_args(Against))
_AGAINST_NAMES = {
    None: "nothing",
    "input": "input, without objects",
    "ibl": "IBL, the baseline",
    "truth": "truth, path-traced",
}


def draw(desk: Desk) -> None:
    """The whole panel."""
    lens = desk.viewport.lens
    heading("Lens")
    lens = _exposed(lens)
    lens = _buffer(lens)
    heading("Compare")
    lens = _compared(desk, lens)
    desk.viewport.lens = lens
    heading("Values")
    label("at the cursor", "I")
    changed, readout = imgui.checkbox("##readout", desk.readout)
    if changed:
        desk.readout = readout
    heading("Screenshot")
    _screenshot(desk)


def _exposed(lens: Lens) -> Lens:
    label("exposure", "Stops on top of the scene's own exposure. Double click: none.")
    changed, stops = imgui.slider_float(
        "##exposure",
        lens.exposure_ev,
        -MOST_EV,
        MOST_EV,
        "%+.2f EV",
        imgui.SliderFlags_.always_clamp,
    )
    if changed:
        lens = replace(lens, exposure_ev=stops)
    if imgui.is_item_hovered() and imgui.is_mouse_double_clicked(0):
        lens = replace(lens, exposure_ev=0.0)
    label("curve", "srgb clips at white, as files are written; filmic presses highlights together.")
    curve = choice("##curve", CURVES, CURVES.index(lens.curve))
    return lens if curve is None else replace(lens, curve=CURVES[curve])


def _buffer(lens: Lens) -> Lens:
    names = list(BUFFERS)
    label("buffer", "What is shown in place of the picture.")
    shown = 0 if lens.buffer is None else 1 + names.index(lens.buffer)
    words = ["the picture", *(name.replace("_", " ") for name in names)]
    chosen = choice("##buffer", words, shown)
    if chosen is None:
        return lens
    return replace(lens, buffer=None if chosen == 0 else names[chosen - 1])


def _compared(desk: Desk, lens: Lens) -> Lens:
    label("with")
    chosen = choice("##against", list(_AGAINST_NAMES.values()), AGAINST.index(lens.against))
    if chosen is not None:
        lens = replace(lens, against=AGAINST[chosen])
    with disabled(lens.against is None):
        label("show", "Side by side, divided by the bar in the picture; or how they differ.")
        error = choice("##error", ("side by side", "error map"), int(lens.error))
        if error is not None:
            lens = replace(lens, error=bool(error))
    if lens.against is not None and desk.sight is not None and desk.sight.caption:
        quiet(desk.sight.caption)
    return lens


def _screenshot(desk: Desk) -> None:
    half = 0.5 * (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x)
    if button(f"{icons.ICON_FA_CAMERA}  PNG", "F12: as it is seen", width=half):
        desk.screenshot(".png")
    imgui.same_line()
    about = "Shift+F12: linear radiance, and the buffer that is shown"
    if button(f"{icons.ICON_FA_CAMERA}  EXR", about, width=half):
        desk.screenshot(".exr")
    quiet(f"to {desk.folder}")
