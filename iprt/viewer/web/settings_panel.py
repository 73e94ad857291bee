"""The tab of the renderer's settings."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from iprt.viewer.controls import compared_presets, preset_of
from iprt.viewer.fields import Field
from iprt.viewer.labels import PARTS
from iprt.viewer.setting_fields import quality_field, rate_field, setting_groups
from iprt.viewer.web.browser_state import BrowserState
from iprt.viewer.web.handles import show
from iprt.viewer.web.inputs import Inputs


class SettingsPanel:
    """Presets, a search, and all settings by group, for use by the window's thread."""

    def __init__(self, ui: BrowserState) -> None:
        self._ui, gui = ui, ui.client.gui
        self._shown: object = object()
        self._inputs = [Inputs(ui, [quality_field(ui)])]
        self._about = gui.add_html("")
        self._inputs.append(Inputs(ui, [rate_field(ui)]))
        part = PARTS["presets"]
        with gui.add_folder(part.name, expand_by_default=False):
            self._presets = gui.add_html("")
        self._words = ""
        search = gui.add_text(PARTS["search"].name, "", hint=PARTS["search"].about)

        async def searched(_event: Any) -> None:
            ui.post(self, lambda: self._search(search.value))

        search.on_update(searched)
        self._folders: list[tuple[tuple[Field, ...], Any]] = []
        for words, fields in setting_groups(ui):
            folder = gui.add_folder(words.name, expand_by_default=False)
            self._folders.append((fields, folder))
            with folder:
                self._inputs.append(Inputs(ui, fields, shown=self._found))

    def _found(self, field: Field) -> bool:
        return field.matches(self._words)

    def _search(self, words: str) -> None:
        """Show the settings that have these words."""
        self._words, self._shown = words, object()
        for fields, folder in self._folders:
            show(folder, "visible", any(map(self._found, fields)))
            show(folder, "expand_by_default", bool(words.strip()))

    def sync(self) -> None:
        """Show changed values."""
        settings = self._ui.settings
        if settings is self._shown and not any(column.touched for column in self._inputs):
            return
        self._shown = settings
        preset = preset_of(settings)
        show(self._about, "content", _differing(preset.text if preset.differing else ""))
        show(self._presets, "content", _table(compared_presets(settings)))
        for column in self._inputs:
            column.sync()


def _differing(text: str) -> str:
    """Return the difference from the preset at a fixed height, so that the inputs stay in place."""
    style = (
        "height:3em;line-height:1.5;font-size:.8em;margin:0 .8em;opacity:.7;overflow:hidden;"
        "overflow-wrap:anywhere"
    )
    return f"<div class='preset' style='{style}' title='{escape(text)}'>{escape(text)}</div>"


def _table(rows: Mapping[str, Mapping[str, str]]) -> str:
    """Return the table of presets; values of now are bold."""
    names = list(next(iter(rows.values())))
    head = "".join(f"<th>{escape(name)}</th>" for name in ("", *names))
    body = "".join(
        f"<tr><td>{escape(key)}</td>{''.join(_cell(row, name) for name in names)}</tr>"
        for key, row in rows.items()
    )
    style = "font-size:.75em;margin:.4em;border-spacing:.6em 0;text-align:left"
    return (
        f"<div style='overflow-x:auto'><table class='presets' style='{style}'>"
        f"<tr>{head}</tr>{body}</table></div>"
    )


def _cell(row: Mapping[str, str], name: str) -> str:
    words = escape(row[name])
    return f"<td>{f'<b>{words}</b>' if row[name] == row['now'] else words}</td>"
