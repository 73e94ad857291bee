"""Inputs of a render to a file, and the rows of the queue, in both viewers.

This module does not draw: `desktop.render_panel` and `web.render_panel` do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import timedelta
from typing import Any

from iprt.errors import IprtError
from iprt.files.message_text import counted
from iprt.files.safe_reading import MAX_SIDE
from iprt.settings.presets import CONVERGED, PRESETS
from iprt.viewer.actions import Action
from iprt.viewer.controls import Slider
from iprt.viewer.fields import Field
from iprt.viewer.labels import Label
from iprt.viewer.render_form import ENDINGS, STILL_ENDINGS, RenderForm, What
from iprt.viewer.render_queue import Render
from iprt.viewer.ui_state import UiState

TAB = Label("Render", "Renders this window's picture to a file, with all unsaved edits.")
QUEUE = Label("Queue", "")
WHAT: Mapping[What, Label] = {
    "frame": Label("This frame", "One picture of the current frame."),
    "clip": Label("All frames", "The whole video. A view with keyframes moves."),
    "range": Label("A range", "The frames from the first to the last below."),
}
AS_SHOWN = Label("as in the viewer", "The settings of the viewer.")
PARTS: Mapping[str, Label] = {
    "render what": Label("Frames", "The frames that are rendered."),
    "render first": Label("First", "Number of the first frame, as in scene.toml."),
    "render last": Label("Last", "Number of the last frame, as in scene.toml."),
    "render around": Label("Whole panorama", "All directions, as an equirectangular picture."),
    "render width": Label("Width", "Pixels; even for a video."),
    "render height": Label("Height", "Pixels; even for a video."),
    "render quality": Label(
        "Quality", "Preset of the settings; all others stay. A still of `final` converges."
    ),
    "render accumulate": Label(
        "View frames", "Frames whose mean is a picture; for quality `final`, at most."
    ),
    "render format": Label("Format", "It is the end of the file's name."),
    "render file": Label(
        "File", "On the machine that renders. A relative path begins at the folder of screenshots."
    ),
}
MOST_ACCUMULATED = 4096
"""End of the slider; more can be typed."""


def render_fields(ui: UiState, form: RenderForm) -> tuple[Field, ...]:
    """Build the fields of the form."""

    def field(key: str, kind: Any, attribute: str, **more: Any) -> Field:
        return Field(
            f"render {key}",
            kind,
            lambda: PARTS[f"render {key}"],
            lambda: getattr(form, attribute),
            lambda value: setattr(form, attribute, value),
            **more,
        )

    def side(key: str, place: int) -> Field:
        return Field(
            f"render {key}",
            "number",
            lambda: PARTS[f"render {key}"],
            lambda: form.size[place],
            lambda pixels: form.resize(**{key: int(pixels)}),
            slider=Slider(1, MAX_SIDE, True, 64.0),
            beyond=True,
        )

    def frames() -> Mapping[Any, Label]:
        return WHAT if len(ui.frames) > 1 else {"frame": WHAT["frame"]}

    def qualities() -> Mapping[Any, Label]:
        still = form.what == "frame"
        return {None: AS_SHOWN} | {
            name: Label(name, "") for name in PRESETS if still or name not in CONVERGED
        }

    def endings() -> Mapping[Any, Label]:
        still = form.what == "frame"
        fitting = {end: label for end, label in ENDINGS.items() if (end in STILL_ENDINGS) == still}
        now = form.ending
        return fitting if now in fitting else {**fitting, now: ENDINGS.get(now, Label(now, ""))}

    ends = Slider(ui.frames[0], max(ui.frames[-1], ui.frames[0] + 1), True, 0.0)
    ranged: dict[str, Any] = {
        "slider": ends,
        "beyond": True,
        "enabled": lambda: form.what == "range",
    }
    return (
        field("what", "choice", "what", options=frames),
        field("first", "number", "first", **ranged),
        field("last", "number", "last", **ranged),
        field("around", "switch", "around"),
        side("width", 0),
        side("height", 1),
        field("quality", "choice", "quality", options=qualities),
        field(
            "accumulate",
            "number",
            "accumulate",
            slider=Slider(1, MOST_ACCUMULATED, True, 1.0),
            beyond=True,
        ),
        field("format", "choice", "ending", options=endings),
        field("file", "text", "file"),
    )


def submit_action(form: RenderForm) -> Action:
    """Return the button that appends the render to the queue."""
    about = "Appends it to the queue. The edits count as they are now."
    return Action("render", Label("Render", about), form.submit)


def queue_actions(ui: UiState, number: int) -> tuple[Action, ...]:
    """Return the buttons of a render in the queue."""
    queue = ui.engine.renders

    def button(
        name: str, about: str, act: Callable[[int], object], visible: Callable[[Render], bool]
    ) -> Action:
        def run() -> None:
            try:
                act(number)
            except IprtError as error:
                ui.say(str(error), bad=True)

        def shown() -> bool:
            found = (render for render in queue.renders if render.number == number)
            return any(visible(render) for render in found)

        label = Label(name, about)
        return Action(f"{name.lower()} {number}", label, run, visible=shown)

    return (
        button("Cancel", "Ends it. Finished frames stay.", queue.cancel, lambda r: r.open),
        button(
            "Again",
            "Renders the same, with the same edits. A video continues with its missing frames.",
            queue.again,
            lambda r: r.state in ("failed", "cancelled"),
        ),
        button(
            "Dismiss", "Takes it off the list. Its file stays.", queue.forget, lambda r: not r.open
        ),
    )


def render_words(render: Render) -> str:
    """Return the state of a render in words."""
    progress = render.progress
    if render.state == "failed":
        return render.problem
    if render.state == "finished":
        return f"written: {render.order.output}"
    if render.state == "cancelled":
        kept = progress.done and len(render.order.frames) > 1
        return f"cancelled; {counted(progress.done, 'frame')} finished" if kept else "cancelled"
    if render.state == "waiting":
        return "waiting"
    if not progress.total:
        return "starting"
    left = render.left_s
    rest = "" if left is None else f", {timedelta(seconds=round(left))} left"
    return f"{progress.done} of {counted(progress.total, 'frame')}{progress.note}{rest}"
