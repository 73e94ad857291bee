"""The objects: which one is edited, where it is, what it is made of."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from iprt.errors import IprtError
from iprt.measure.metrics import srgb_encode
from iprt.scene.edit import free_name
from iprt.scene.images import decode_srgb
from iprt.scene.material import Material, MaterialKind
from iprt.scene.mesh_files import MESH_SUFFIXES
from iprt.toml_text import printable
from iprt.viewer.objects import ObjectState
from iprt.viewer.web.binding import Binding, on_click, on_trigger

if TYPE_CHECKING:
    from iprt.viewer.web.browser import Browser

NONE = "none"
LONGEST = 60
"""Of a file's name, which has at most 255 bytes with what else it will have in the scene."""
QUIET = (60, 66, 74)
"""Of buttons."""
ROUGH = Material("plastic")


class ObjectPanel:
    """Of one browser; edits are those of all. Of the window's thread."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        gui, post = browser.client.gui, browser.post
        self._bindings: list[Binding] = []
        self._known: tuple[str, ...] = ()
        with gui.add_folder("Object"):
            self._names = gui.add_dropdown(
                "Selected", (NONE,), hint="Or click one in the picture; Shift+click puts it there"
            )
            self._bind(self._names, self._selected, self._select)
            self._edited = [*self._add_place(), *self._add_material()]
            self._plain = gui.add_button(
                "Without its texture",
                color=QUIET,
                hint="Textures of mesh files, and of all but diffuse materials, cannot be saved",
            )
            on_click(self._plain, post, self._take_texture)
            remove = gui.add_button("Remove", icon="trash", color=QUIET)
            on_click(remove, post, self._remove)
            self._edited.append(remove)
        upload = gui.add_upload_button(
            "Add a mesh",
            icon="plus",
            color=QUIET,
            mime_type=",".join(MESH_SUFFIXES),
            hint="Set down in the middle of the view",
        )

        async def uploaded(event: Any) -> None:
            file = event.target.value
            post(object(), lambda: self._add(file.name, file.content))

        upload.on_upload(uploaded)
        undo = gui.add_button(
            "Undo", icon="arrow-back-up", color=QUIET, hint="The last edit, of anybody"
        )
        on_click(undo, post, browser.engine.undo)
        self._add_keys()
        self.sync()

    def _add_keys(self) -> None:
        browser, gui = self._browser, self._browser.client.gui
        keys = (
            ("Undo", "Z", "cmd/ctrl", browser.engine.undo),
            ("Redo", "Z", "cmd/ctrl+shift", browser.engine.redo),
            ("Remove the selected object", "delete", None, self._remove),
        )
        for label, key, modifier, do in keys:
            command = gui.add_command(label, hotkey=key, modifier=modifier)
            on_trigger(command, browser.post, do)

    def _bind(self, handle: Any, read: Any, write: Any) -> None:
        browser = self._browser
        self._bindings.append(Binding(handle, read, write, browser.post, browser.tell))

    # Which one --------------------------------------------------------------------------------

    def _selected(self) -> str:
        name = self._browser.selected
        return name if name is not None and name in self._known else NONE

    def _select(self, name: str) -> None:
        self._browser.selected = None if name == NONE else name

    def _remove(self) -> None:
        if self._browser.selected is not None:
            self._browser.engine.remove(self._browser.selected)

    def _take_texture(self) -> None:
        state = self._browser.selected_state
        if state is not None:
            plain = replace(state.materials[0], texture=None)
            self._browser.engine.paint(state.name, plain)

    def _add(self, name: str, content: bytes) -> None:
        browser = self._browser
        stem, suffix = free_name(Path(name).stem[:LONGEST], set()), Path(name).suffix.lower()
        if suffix not in MESH_SUFFIXES:
            raise IprtError(
                f"{printable(name, 80)}: not a mesh; these are read: {', '.join(MESH_SUFFIXES)}"
            )
        # In a folder of its own: it is read again when the scene is saved.
        path = Path(tempfile.mkdtemp(dir=browser.uploads)) / f"{stem}{suffix}"
        path.write_bytes(content)
        browser.selected = browser.engine.add(path, *browser.viewport.aim(0.5, 0.5))

    def sync(self) -> None:
        browser = self._browser
        names = tuple(state.name for state in browser.engine.objects)
        if names != self._known:
            if browser.selected in set(self._known) - set(names):
                browser.selected = None
            self._known = names
            self._names.options = (NONE, *names)
        state = browser.selected_state
        shown = state is not None
        textured = state is not None and state.materials[0].texture is not None
        for handle in (*self._edited, self._plain):
            visible = textured if handle is self._plain else shown
            if handle.visible != visible:
                handle.visible = visible
        for binding in self._bindings:
            binding.sync()

    # Where it is ------------------------------------------------------------------------------

    def _add_place(self) -> list[Any]:
        browser, gui = self._browser, self._browser.client.gui
        position = gui.add_vector3("Position", (0.0, 0.0, 0.0), step=0.01, hint="m, in the world")
        self._bind(position, self._position, self._move)
        size = gui.add_number("Size", 1.0, min=0.001, max=1000.0, step=0.01, hint="m, longest side")
        self._bind(size, self._size, self._resize)
        snapping = gui.add_checkbox(
            "Stay on surfaces", False, hint="Of the video, by its depth, while it is dragged"
        )
        self._bind(snapping, lambda: browser.snapping, lambda on: setattr(browser, "snapping", on))
        aligned = gui.add_checkbox(
            "Align with them", False, hint="Its own +Y is turned to the surface's normal"
        )
        self._bind(aligned, lambda: browser.aligned, lambda on: setattr(browser, "aligned", on))
        return [position, size, snapping, aligned]

    def _position(self) -> tuple[float, ...]:
        state = self._browser.selected_state
        if state is None:
            return (0.0, 0.0, 0.0)
        return tuple(round(float(value), 4) for value in state.to_world[:3, 3])

    def _move(self, position: tuple[float, ...]) -> None:
        state = self._browser.selected_state
        if state is not None:
            to_world = state.to_world.copy()
            to_world[:3, 3] = position
            self._browser.engine.place(state.name, state.placed(to_world))

    def _size(self) -> float:
        state = self._browser.selected_state
        return 1.0 if state is None else round(_longest(state), 4)

    def _resize(self, size: float) -> None:
        state = self._browser.selected_state
        if state is None or not size > 0.0:
            return
        low, high = state.corners
        foot = np.array([0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])])
        to_world = state.to_world.copy()
        factor = size / _longest(state)
        # About the middle of its lower side, so that it stands where it stood.
        to_world[:3, 3] += (1.0 - factor) * to_world[:3, :3] @ foot
        to_world[:3, :3] *= factor
        self._browser.engine.place(state.name, state.placed(to_world))

    # What it is made of -----------------------------------------------------------------------

    def _add_material(self) -> list[Any]:
        gui = self._browser.client.gui
        kind = gui.add_dropdown("Material", get_args(MaterialKind), hint="Of all of the object")
        self._paints(kind, lambda m: m.kind, lambda m, kind: replace(m, kind=kind))
        color = gui.add_rgb("Colour", (128, 128, 128), hint="Albedo, or a metal's reflectance")
        self._paints(color, _displayed, lambda m, rgb: replace(m, albedo=_linear(rgb)))
        rough = gui.add_slider("Roughness", 0.0, 1.0, 0.005, 0.1, hint="GGX alpha; 0 is a mirror")
        self._paints(rough, lambda m: m.alpha, lambda m, alpha: replace(m, alpha=alpha))
        ior = gui.add_slider("Refraction", 1.01, 3.0, 0.01, 1.5, hint="Index of a plastic's coat")
        self._paints(ior, lambda m: m.ior, lambda m, ior: replace(m, ior=ior))
        return [kind, color, rough, ior]

    def _paints(self, handle: Any, part: Any, changed: Any) -> None:
        browser = self._browser

        def read() -> Any:
            state = browser.selected_state
            return part(ROUGH if state is None else state.materials[0])

        def write(value: Any) -> None:
            state = browser.selected_state
            if state is not None:
                browser.engine.paint(state.name, changed(state.materials[0], value))

        self._bind(handle, read, write)


def _longest(state: ObjectState) -> float:
    """Metres, of the sides of the object's own box."""
    low, high = state.corners
    return float(((high - low) * np.linalg.norm(state.to_world[:3, :3], axis=0)).max())


def _displayed(material: Material) -> tuple[int, ...]:
    levels = np.rint(255.0 * srgb_encode(np.clip(np.array(material.albedo), 0.0, 1.0)))
    return tuple(int(level) for level in levels)


def _linear(rgb: tuple[int, ...]) -> tuple[float, float, float]:
    red, green, blue = decode_srgb(np.array([[rgb]], np.uint8))[0, 0]
    return float(red), float(green), float(blue)
