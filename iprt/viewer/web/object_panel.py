"""The objects: which one is edited, where it is, what it is made of."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from iprt.errors import IprtError
from iprt.files.images import decode_srgb
from iprt.files.toml_text import printable
from iprt.geometry.material import Material
from iprt.geometry.mesh_files import MESH_SUFFIXES
from iprt.output.display import srgb_encode
from iprt.scene.edit import free_name
from iprt.viewer.labels import MATERIALS, PARTS
from iprt.viewer.objects import ObjectState
from iprt.viewer.web.binding import Binding, Choice, on_click, on_trigger, show
from iprt.viewer.web.browser_api import BrowserApi
from iprt.viewer.web.files_panel import QUIET

NONE = "none"
LONGEST = 60
"""Characters of a file's name, which has at most 255 bytes with what the scene adds to it."""
ROUGH = Material("plastic")
SRGB = "The numbers here are sRGB, from 0 to 255; scene.toml has linear ones, from 0 to 1."


class ObjectPanel:
    """One browser's panel; edits are those of all. The window's thread uses it."""

    def __init__(self, browser: BrowserApi) -> None:
        self._browser = browser
        gui, post = browser.client.gui, browser.post
        self._bindings: list[Binding] = []
        self._known: tuple[str, ...] = ()
        self._add_upload()
        with gui.add_folder("Object"):
            self._names = gui.add_dropdown(
                "Selected", (NONE,), hint="Or click one in the picture; Shift+click puts it there"
            )
            self._bind(self._names, self._selected, self._select)
            self._edited = [*self._add_place(), *self._add_material()]
            texture, removed = PARTS["texture"], PARTS["remove"]
            self._plain = gui.add_button(texture.name, color=QUIET, hint=texture.about)
            on_click(self._plain, post, self._take_texture)
            remove = gui.add_button(
                removed.name, icon="trash", color=QUIET, hint=f"{removed.about} Key: Delete."
            )
            on_click(remove, post, self._remove)
            self._edited.append(remove)
        command = gui.add_command("Remove the selected object", hotkey="delete")
        on_trigger(command, post, self._remove)
        self.sync()

    def _add_upload(self) -> None:
        browser, part = self._browser, PARTS["add"]
        upload = browser.client.gui.add_upload_button(
            part.name,
            icon="plus",
            color=QUIET,
            mime_type=",".join(MESH_SUFFIXES),
            hint=f"{part.about} It stands in the middle of the view.",
        )

        async def uploaded(event: Any) -> None:
            file = event.target.value
            browser.post(object(), lambda: self._add(file.name, file.content))

        upload.on_upload(uploaded)

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
            show(handle, "visible", textured if handle is self._plain else shown)
        self._show_parts()
        for binding in self._bindings:
            binding.sync()

    # Where it is ------------------------------------------------------------------------------

    def _add_place(self) -> list[Any]:
        browser, gui = self._browser, self._browser.client.gui
        part = PARTS["position"]
        position = gui.add_vector3(part.name, (0.0, 0.0, 0.0), step=0.01, hint=part.about)
        self._bind(position, self._position, self._move)
        part = PARTS["size"]
        size = gui.add_number(part.name, 1.0, min=0.001, max=1000.0, step=0.01, hint=part.about)
        self._bind(size, self._size, self._resize)
        snapping = gui.add_checkbox(PARTS["snap"].name, False, hint=PARTS["snap"].about)
        self._bind(snapping, lambda: browser.snapping, lambda on: setattr(browser, "snapping", on))
        aligned = gui.add_checkbox(PARTS["align"].name, False, hint=PARTS["align"].about)
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
        browser = self._browser
        kind = Choice(
            gui,
            PARTS["material"],
            MATERIALS,
            lambda: self._material.kind,
            lambda kind: self._paint(kind=kind),
            browser.post,
            browser.tell,
        )
        self._bindings.append(kind)
        self._color = gui.add_rgb("", (128, 128, 128))
        self._bind(
            self._color,
            lambda: _displayed(self._material),
            lambda rgb: self._paint(albedo=_linear(rgb)),
        )
        part = PARTS["alpha"]
        self._alpha = gui.add_slider(part.name, 0.0, 1.0, 0.005, 0.1, hint=part.about)
        self._bind(
            self._alpha, lambda: self._material.alpha, lambda alpha: self._paint(alpha=alpha)
        )
        part = PARTS["ior"]
        self._ior = gui.add_slider(part.name, 1.01, 3.0, 0.01, 1.5, hint=part.about)
        self._bind(self._ior, lambda: self._material.ior, lambda ior: self._paint(ior=ior))
        return [kind.handle, self._color, self._alpha, self._ior]

    @property
    def _material(self) -> Material:
        state = self._browser.selected_state
        return ROUGH if state is None else state.materials[0]

    def _paint(self, **part: Any) -> None:
        """Change a part of the selected object's material."""
        state = self._browser.selected_state
        if state is not None:
            self._browser.engine.paint(state.name, replace(state.materials[0], **part))

    def _show_parts(self) -> None:
        """Tell what the material's parts are, and which of them count."""
        kind = self._material.kind
        part = PARTS["reflectance" if kind == "conductor" else "albedo"]
        show(self._color, "label", f"{part.name} (sRGB)")
        show(self._color, "hint", f"{part.about} {SRGB}")
        show(self._alpha, "disabled", kind == "diffuse")
        show(self._ior, "disabled", kind != "plastic")


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
