"""The panels beside the picture: tabs, with the status above them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from iprt.geometry.mesh_files import MESH_SUFFIXES
from iprt.viewer.actions import Action, actions, offer_actions
from iprt.viewer.arranging_fields import array_fields, group_field, name_field, step_fields
from iprt.viewer.fields import (
    Field,
    attribute_switch,
    lens_fields,
    look_fields,
    place_fields,
    playback_fields,
    selected_field,
    view_field,
    visibility_field,
)
from iprt.viewer.labels import PARTS, PICTURE
from iprt.viewer.light_fields import light_fields, sun_fields
from iprt.viewer.looking import pin
from iprt.viewer.looking_fields import range_fields
from iprt.viewer.material_fields import material_fields
from iprt.viewer.render_fields import TAB
from iprt.viewer.timeline_fields import (
    key_fields,
    record_field,
    timeline_actions,
    view_name_field,
)
from iprt.viewer.ui_state import require_mesh
from iprt.viewer.virtual_light_fields import virtual_light_fields
from iprt.viewer.web.browser_state import BrowserState
from iprt.viewer.web.handles import do_on, show
from iprt.viewer.web.inputs import QUIET, Inputs
from iprt.viewer.web.looking_panel import distribution_html, pixels_html
from iprt.viewer.web.profile_panel import ProfilePanel
from iprt.viewer.web.render_panel import RenderPanel
from iprt.viewer.web.settings_panel import SettingsPanel
from iprt.viewer.web.status import status_html

WIDTH_PX = 340
ARRANGING = ("duplicate", "copy", "paste", "settle", "group", "ungroup", "lock", "hide", "show all")
"""Actions that arrange the selected objects."""
TAKEN = ("save", "copy", "paste", "brighter", "darker")
"""Actions whose keys browsers, or viser's camera, keep for themselves."""


class Panels:
    """All panels of one browser, for use by the window's thread.

    Browsers share edits, playback and settings.
    """

    def __init__(self, ui: BrowserState) -> None:
        self._ui, self._gui = ui, ui.client.gui
        self._syncs: list[Callable[[], None]] = []
        gui = self._gui
        gui.set_panel_label(f"iprt  ·  {ui.engine.scene.name}")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH_PX)
        self._add_html(lambda: status_html(ui))
        self._add_offer()
        tabs = gui.add_tab_group()
        with tabs.add_tab("Scene"):
            self._add_scene()
        with tabs.add_tab("Light"):
            self._add(*light_fields(ui))
            with gui.add_folder(PARTS["sun"].name):
                self._add(*sun_fields(ui))
            self._add_html(lambda: _told(ui.engine.light_lines))
        with tabs.add_tab(PICTURE.name):
            self._add_picture()
        with tabs.add_tab("Settings"):
            self._syncs.append(SettingsPanel(ui).sync)
        with tabs.add_tab("Profile"):
            self._syncs.append(ProfilePanel(ui).sync)
        with tabs.add_tab(TAB.name):
            self._syncs.append(RenderPanel(ui).sync)

    def sync(self) -> None:
        """Show changed values in all panels."""
        for sync in self._syncs:
            sync()

    def _add(
        self,
        *rows: Field | Action,
        visible: Callable[[], bool] = lambda: True,
        sparse: bool = False,
    ) -> None:
        self._syncs.append(Inputs(self._ui, rows, visible=visible, sparse=sparse).sync)

    def _add_html(self, content: Callable[[], str]) -> None:
        handle = self._gui.add_html("")
        self._syncs.append(lambda: show(handle, "content", content()))

    def _add_offer(self) -> None:
        """Add the question about unsaved edits of an earlier viewer."""
        ui, part = self._ui, PARTS["offer"]
        folder = self._gui.add_folder(part.name, visible=False)

        def lines() -> str:
            offer = ui.engine.autosaver.offer
            return "" if offer is None else _told([("", offer.text), ("", part.about)])

        with folder:
            self._add_html(lines)
            self._add(*offer_actions(ui))
        self._syncs.append(lambda: show(folder, "visible", ui.engine.autosaver.offer is not None))

    # The tab of the picture -------------------------------------------------------------------

    def _add_picture(self) -> None:
        ui, shared = self._ui, actions(self._ui)

        def pin_read() -> None:
            if ui.read is not None:
                pin(ui, *ui.read_at)

        self._add(*lens_fields(ui))
        self._add(shared["snapshot"], shared["flip"], shared["back to snapshot"])
        self._add_html(lambda: distribution_html(ui))
        self._add(*range_fields(ui), sparse=True)
        self._add(shared["auto range"])
        self._add_html(lambda: pixels_html(ui))
        pinning = Action("pin", PARTS["pin"], pin_read, enabled=lambda: ui.read is not None)
        self._add(pinning, shared["unpin"])

    # The tab of the scene ---------------------------------------------------------------------

    def _add_scene(self) -> None:
        ui, gui, shared = self._ui, self._gui, actions(self._ui)
        self._add(view_field(ui))
        self._add_object(shared)
        if len(ui.frames) > 1:
            with gui.add_folder("Video"):
                self._add(*playback_fields(ui))
                self._add_html(lambda: _counted(ui.viewport.counter or ""))
        timed = timeline_actions(ui)
        with gui.add_folder("Keyframes", expand_by_default=False):
            self._add(timed["key"], record_field(ui), *key_fields(ui), timed["delete keys"])
        self._add_visibility()
        self._add_upload()
        self._add(shared["light"], shared["undo"], shared["redo"], shared["save"])
        with gui.add_folder(PARTS["view"].name, expand_by_default=False):
            self._add(view_name_field(ui), *look_fields(ui))
            self._add(*(timed[name] for name in ("add view", "look", "remove view")))
        self._add_screenshots()
        for action in (timed["key"], *shared.values()):
            if action.keys and action.name not in TAKEN:
                self._bind_key(action)

    def _add_object(self, shared: Mapping[str, Action]) -> None:
        """Add the folder of the selected objects."""
        ui, gui, selected = self._ui, self._gui, shared["remove"].visible
        dragging = (
            attribute_switch(ui, "snap", "snapping"),
            attribute_switch(ui, "align", "align"),
        )
        with gui.add_folder("Object"):
            self._add(selected_field(ui))
            self._add(name_field(ui), *place_fields(ui), *dragging, visible=selected, sparse=True)
            for fields, has in ((material_fields, "materials"), (virtual_light_fields, "light")):

                def visible(has: str = has) -> bool:
                    return bool(getattr(ui.state, has, None))

                self._add(*fields(ui), visible=visible, sparse=True)
            self._add(shared["bare"], shared["remove"])
            arranging = gui.add_folder("Arrange", expand_by_default=False)
            with arranging:
                self._add(
                    *(shared[name] for name in ARRANGING),
                    *step_fields(ui),
                    group_field(ui),
                    *array_fields(ui),
                    shared["array"],
                    visible=selected,
                )
            self._syncs.append(lambda: show(arranging, "visible", selected()))

    def _bind_key(self, action: Action) -> None:
        """Bind the last of an action's keys."""
        *modifiers, key = action.keys.rpartition(", ")[2].split("+")
        command = self._gui.add_command(
            action.label.name,
            hotkey=key if len(key) == 1 else key.lower(),
            modifier="+".join(modifiers).lower().replace("ctrl", "cmd/ctrl") or None,
        )
        do_on(command.on_trigger, self._ui.post, action.act)

    def _add_screenshots(self) -> None:
        ui, part = self._ui, PARTS["screenshot"]
        pictures = self._gui.add_button_group(part.name, ("PNG", "EXR"), hint=part.about)

        def send(suffix: str) -> None:
            with tempfile.TemporaryDirectory() as folder:
                path = ui.viewport.screenshot(suffix, Path(folder))
                ui.client.send_file_download(path.name, path.read_bytes(), save_immediately=True)

        async def wanted(event: Any) -> None:
            suffix = f".{event.target.value.lower()}"
            ui.post(object(), lambda: send(suffix))

        pictures.on_click(wanted)

    def _add_visibility(self) -> None:
        """Add a check box for each object."""
        ui, known, boxes = self._ui, list[tuple[str, bool]](), Inputs(self._ui, ())
        folder = self._gui.add_folder(PARTS["objects"].name, visible=False)

        def sync() -> None:
            nonlocal known, boxes
            states = ui.engine.objects
            wanted = [(state.name, state.keyframed) for state in states]
            if wanted != known:
                known = wanted
                boxes.remove()
                with folder:
                    boxes = Inputs(ui, [visibility_field(ui, state) for state in states])
                folder.visible = bool(wanted)
            boxes.sync()

        self._syncs.append(sync)

    def _add_upload(self) -> None:
        ui, part = self._ui, PARTS["add"]
        upload = self._gui.add_upload_button(
            part.name,
            icon="plus",
            color=QUIET,
            mime_type=",".join(MESH_SUFFIXES),
            hint=f"{part.about} It stands in the middle of the view.",
        )

        def add(name: str, content: bytes) -> None:
            require_mesh(Path(name))
            ui.add(ui.received(name, content), 0.5, 0.5)

        async def uploaded(event: Any) -> None:
            file = event.target.value
            ui.post(object(), lambda: add(file.name, file.content))

        upload.on_upload(uploaded)


def _counted(text: str) -> str:
    """Return the counter beside the column of labels, at a fixed height."""
    style = "font-size:.8em;height:1.8em;padding:0 .8em 0 9em;font-variant-numeric:tabular-nums"
    return f"<div class='counter' style='{style}'>{escape(text)}</div>"


def _told(lines: Sequence[tuple[str, str]]) -> str:
    """Return labels and sentences as paragraphs."""
    style = "font-size:.8em;margin:.4em .8em;overflow-wrap:anywhere"
    return "".join(
        f"<p class='told' style='{style}'><b>{escape(name)}</b> {escape(words)}</p>"
        for name, words in lines
    )
