"""The panel of renders to files: the form, and the queue."""

from __future__ import annotations

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.viewer.desktop.style import BAD
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.widgets import action_button, draw_field, heading, quiet
from iprt.viewer.render_fields import (
    QUEUE,
    TAB,
    queue_actions,
    render_fields,
    render_words,
    submit_action,
)
from iprt.viewer.render_queue import Render


def draw(ui: DesktopState) -> None:
    """Draw the panel."""
    form = ui.render_form
    quiet(TAB.about)
    for field in render_fields(ui, form):
        if field.enabled():
            draw_field(ui, field)
    imgui.spacing()
    action_button(submit_action(form), icons.ICON_FA_FILM, width=-1.0)
    if form.problem:
        _bad(form.problem)
    else:
        quiet(form.place)
    heading(QUEUE.name)
    renders = ui.engine.renders.renders
    if not renders:
        quiet("Nothing is rendered.")
    for render in renders:
        _render(ui, render)


def _render(ui: DesktopState, render: Render) -> None:
    imgui.spacing()
    imgui.text_unformatted(render.order.output.name)
    imgui.progress_bar(render.share, imgui.ImVec2(-1.0, 0.5 * imgui.get_font_size()), "")
    (_bad if render.state == "failed" else quiet)(render_words(render))
    for action in queue_actions(ui, render.number):
        if action.visible():
            action_button(action, "", width=0.0)
            imgui.same_line()
    imgui.new_line()


def _bad(text: str) -> None:
    imgui.push_text_wrap_pos(0.0)
    imgui.text_colored(imgui.ImVec4(*BAD), text)
    imgui.pop_text_wrap_pos()
