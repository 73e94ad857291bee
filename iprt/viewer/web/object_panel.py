"""The panel of objects: selection, placement, material."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from iprt.errors import IprtError
from iprt.files.message_text import printable
from iprt.geometry.mesh_files import MESH_SUFFIXES
from iprt.scene.manifest_writing import free_name
from iprt.viewer.fields import Field, material_fields, place_fields
from iprt.viewer.labels import PARTS, Label
from iprt.viewer.web.binding import do_on, show
from iprt.viewer.web.browser_state import BrowserState
from iprt.viewer.web.files_panel import QUIET
from iprt.viewer.web.inputs import Inputs

NONE = Label("none", "")
LONGEST = 60
"""Limit for the characters of a file name, which may have 255 bytes with the scene's additions."""


class ObjectPanel:
    """The objects panel, for use by the window's thread; all browsers share edits."""

    def __init__(self, ui: BrowserState) -> None:
        self._ui = ui
        gui = ui.client.gui
        self._add_upload()
        with gui.add_folder("Object"):
            self._names = Inputs(ui, [_selected(ui)])
            fields = [*place_fields(ui), *_dragging(ui), *material_fields(ui)]
            self._inputs = Inputs(ui, fields, visible=lambda: ui.state is not None)
            texture, removed = PARTS["texture"], PARTS["remove"]
            self._plain = gui.add_button(texture.name, color=QUIET, hint=texture.about)
            do_on(self._plain.on_click, ui.post, lambda: ui.paint(texture=None))
            self._remove = gui.add_button(
                removed.name, icon="trash", color=QUIET, hint=f"{removed.about} Key: Delete."
            )
            do_on(self._remove.on_click, ui.post, ui.remove)
        command = gui.add_command("Remove the selected object", hotkey="delete")
        do_on(command.on_trigger, ui.post, ui.remove)
        self.sync()

    def _add_upload(self) -> None:
        ui, part = self._ui, PARTS["add"]
        upload = ui.client.gui.add_upload_button(
            part.name,
            icon="plus",
            color=QUIET,
            mime_type=",".join(MESH_SUFFIXES),
            hint=f"{part.about} It stands in the middle of the view.",
        )

        async def uploaded(event: Any) -> None:
            file = event.target.value
            ui.post(object(), lambda: self._add(file.name, file.content))

        upload.on_upload(uploaded)

    def _add(self, name: str, content: bytes) -> None:
        ui = self._ui
        stem, suffix = free_name(Path(name).stem[:LONGEST], set()), Path(name).suffix.lower()
        if suffix not in MESH_SUFFIXES:
            raise IprtError(
                f"{printable(name, 80)}: not a mesh; these are read: {', '.join(MESH_SUFFIXES)}"
            )
        # Keep the file in its own folder: saving the scene reads it again.
        path = Path(tempfile.mkdtemp(dir=ui.uploads)) / f"{stem}{suffix}"
        path.write_bytes(content)
        ui.selected = ui.engine.add(path, *ui.viewport.aim(0.5, 0.5))

    def sync(self) -> None:
        """Show changed values."""
        state = self._ui.state
        self._names.sync()
        self._inputs.sync()
        textured = state is not None and state.materials[0].texture is not None
        show(self._plain, "visible", textured)
        show(self._remove, "visible", state is not None)


def _selected(ui: BrowserState) -> Field:
    part = PARTS["selected"]
    about = Label(part.name, f"{part.about} Shift+click puts it there.")

    def options() -> Mapping[Any, Label]:
        names = {state.name: Label(state.name, "") for state in ui.engine.objects}
        return {None: NONE, **names}

    def read() -> str | None:
        return ui.selected if ui.selected in options() else None

    return Field(
        "selected",
        "choice",
        lambda: about,
        read,
        lambda name: setattr(ui, "selected", name),
        options,
    )


def _dragging(ui: BrowserState) -> list[Field]:
    """Build the fields that control dragging by the gizmo."""
    return [
        Field(
            "snap",
            "switch",
            lambda: PARTS["snap"],
            lambda: ui.snapping,
            lambda on: setattr(ui, "snapping", on),
        ),
        Field(
            "align",
            "switch",
            lambda: PARTS["align"],
            lambda: ui.align,
            lambda on: setattr(ui, "align", on),
        ),
    ]
