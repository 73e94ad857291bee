"""Fields and actions of keyframes and of the scene's views."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from iprt.viewer.actions import Action
from iprt.viewer.controls import Slider
from iprt.viewer.fields import NONE, Field
from iprt.viewer.labels import INTERPOLATIONS, PARTS, Label
from iprt.viewer.timeline import Chosen, Row
from iprt.viewer.ui_state import UiState

NEW_VIEW = "view"


def key_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the fields of the keys of the primary object, or of the view without one."""
    timeline = ui.timeline

    def row() -> Row | None:
        return timeline.primary

    def chosen() -> Chosen | None:
        now = row()
        keys = () if now is None else (now.key(key.time) for key in now.keys)
        return next((key for key in keys if key in timeline.chosen), None)

    def there() -> bool:
        return chosen() is not None

    def options() -> Mapping[Any, Label]:
        found: dict[Any, Label] = {None: NONE}
        if (now := row()) is not None:
            for key in now.keys:
                name = f"{timeline.frame_of(key.time):g}, {key.interpolation}"
                found[now.key(key.time)] = Label(name, "")
        return found

    def choose(key: Chosen | None) -> None:
        timeline.choose(*([] if key is None else [key]))
        if key is not None:
            ui.engine.seek(round(timeline.frame_of(key[2])))

    def frame() -> int:
        key = chosen()
        return ui.frames[0] if key is None else round(timeline.frame_of(key[2]))

    def interpolation() -> str:
        now, key = row(), chosen()
        if now is None or key is None:
            return "linear"
        return next(str(k.interpolation) for k in now.keys if k.time == key[2])

    ends = Slider(ui.frames[0], max(ui.frames[-1], timeline.last_frame), True, 0.0)
    return (
        Field("key", "choice", lambda: PARTS["keys"], chosen, choose, options),
        Field(
            "key_frame",
            "number",
            lambda: PARTS["key_frame"],
            frame,
            lambda frame_: timeline.shift(int(frame_) - frame()),
            slider=ends,
            beyond=True,
            enabled=there,
        ),
        Field(
            "interpolation",
            "choice",
            lambda: PARTS["interpolation"],
            interpolation,
            timeline.interpolate,
            lambda: INTERPOLATIONS,
            enabled=there,
        ),
    )


def record_field(ui: UiState) -> Field:
    """Build the switch that sets keys where objects are moved."""
    selection = ui.selection
    return Field(
        "recording",
        "switch",
        lambda: PARTS["recording"],
        lambda: selection.recording,
        lambda on: setattr(selection, "recording", on),
    )


def view_name_field(ui: UiState) -> Field:
    """Build the name of the view that the window showed last."""

    def write(name: str) -> None:
        old = ui.timeline.view
        if old is None or not name.strip():
            return
        new, viewport = ui.engine.view_editor.rename(old, name), ui.viewport
        viewport.last_name = new
        if viewport.name == old:
            viewport.name = new

    return Field(
        "view_name",
        "text",
        lambda: PARTS["view_name"],
        lambda: ui.timeline.view or "",
        write,
        enabled=lambda: ui.timeline.view is not None,
    )


def timeline_actions(ui: UiState) -> dict[str, Action]:
    """Return the actions on keyframes and views, by name."""
    timeline, editor = ui.timeline, ui.engine.view_editor

    def known() -> bool:
        return timeline.view is not None

    def still() -> bool:
        return timeline.view is not None and ui.engine.views[timeline.view].motion is None

    def perspective() -> bool:
        return ui.viewport.view.projection == "perspective"

    def add() -> None:
        ui.go_to(editor.add(NEW_VIEW, ui.viewport.view, ui.viewport.objects))

    def look() -> None:
        if timeline.view is not None:
            editor.look(timeline.view, ui.viewport.view)
            ui.go_to(timeline.view)

    def remove() -> None:
        if timeline.view is not None:
            editor.remove(timeline.view)
            ui.say("the view is removed; Ctrl+Z brings it back")

    found = (
        Action("key", PARTS["key"], timeline.set_key, "I"),
        Action(
            "delete keys",
            PARTS["delete keys"],
            timeline.delete,
            "Delete",
            enabled=lambda: bool(timeline.chosen),
        ),
        Action("add view", PARTS["add view"], add, enabled=perspective),
        Action("look", PARTS["look"], look, enabled=lambda: still() and perspective()),
        Action("remove view", PARTS["remove view"], remove, enabled=known),
    )
    return {action.name: action for action in found}
