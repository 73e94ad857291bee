"""The panel of the scene: its views, its objects, and the one that is selected."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.geometry.material import Material, MaterialKind
from iprt.viewer import labels
from iprt.viewer.desktop.style import ACCENT, TEXT
from iprt.viewer.desktop.ui_state import UiState
from iprt.viewer.desktop.widgets import (
    button,
    choice,
    disabled,
    heading,
    hint,
    label,
    linear_color,
    part,
    quiet,
    slider,
)
from iprt.viewer.labels import PARTS, TURNED, Label
from iprt.viewer.objects import ObjectState
from iprt.viewer.viewport import MAX_FOV_DEG, MIN_FOV_DEG

KINDS: tuple[MaterialKind, ...] = get_args(MaterialKind)
MIN_IOR, MAX_IOR = 1.01, 3.0
"""Ends of the slider."""


def draw(ui: UiState) -> None:
    """The whole panel."""
    _files(ui)
    heading("View")
    _view(ui)
    heading(PARTS["objects"].name)
    _objects(ui)
    state = ui.state
    if state is not None:
        heading(state.name)
        _placement(ui, state)
        _material(ui, state)


def _files(ui: UiState) -> None:
    engine, gap = ui.engine, imgui.get_style().item_spacing.x
    third = (imgui.get_content_region_avail().x - 2.0 * gap) / 3.0
    half = 0.5 * (third - gap)
    for name, icon, key, wide, enabled, act in (
        ("add", f"{icons.ICON_FA_PLUS}  Add mesh", "A", third, True, ui.browse),
        ("save", f"{icons.ICON_FA_FLOPPY_DISK}  Save", "Ctrl+S", third, ui.unsaved, ui.save),
        ("undo", icons.ICON_FA_ROTATE_LEFT, "Ctrl+Z", half, engine.can_undo, ui.undo),
        ("redo", icons.ICON_FA_ROTATE_RIGHT, "Ctrl+Y", half, engine.can_redo, ui.redo),
    ):
        words = PARTS[name]
        about = f"{words.name} ({key}). {words.about}"
        if button(f"{icon}##{name}", about, width=wide, enabled=enabled):
            act()
        imgui.same_line()
    imgui.new_line()


def _view(ui: UiState) -> None:
    viewport = ui.viewport
    names = list(ui.engine.scene.views)
    if names:
        part("view")
        # Another scene.toml may lack the view by now.
        known = viewport.name is not None and viewport.name in names
        panorama = viewport.view.projection == "equirect"
        shown = names if known else [*names, "(panorama)" if panorama else TURNED]
        options = [Label(name, "") for name in shown]
        chosen = choice(
            "##view", options, shown.index(viewport.name or "") if known else len(names)
        )
        if chosen is not None and chosen < len(names):
            viewport.go_to(names[chosen])
    view = viewport.view
    if view.projection == "equirect":
        quiet("The whole panorama: choose a view to look around.")
        return
    label("Yaw, pitch", "Degrees right and up. Drag the picture to look around.")
    changed, (yaw, pitch) = imgui.drag_float2(
        "##direction", [view.yaw_deg, view.pitch_deg], 0.25, -180.0, 180.0, "%.2f°", _CLAMPED
    )
    if changed:
        viewport.look(replace(view, yaw_deg=yaw, pitch_deg=min(max(pitch, -90.0), 90.0)))
    label("Field of view", "Vertical. The mouse's wheel changes it.")
    fov = slider("##fov", view.fov_y_deg, (MIN_FOV_DEG, MAX_FOV_DEG), "{:.1f}°".format)
    if fov is not None:
        viewport.look(replace(view, fov_y_deg=round(fov, 1)))


_CLAMPED = imgui.SliderFlags_.always_clamp


def _objects(ui: UiState) -> None:
    states, shown = ui.engine.objects, ui.viewport.objects
    if not states and ui.displayed is not None:  # before that they are only not read yet
        quiet("None yet: drop a .glb, .gltf, .obj, .ply or .stl file on the picture.")
    for state in states:
        visible = shown is None or state.name in shown
        imgui.push_id(state.name)
        icon = icons.ICON_FA_EYE if visible else icons.ICON_FA_EYE_SLASH
        imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(0, 0, 0, 0))
        if button(icon, "Show or hide it here", width=2.0 * imgui.get_font_size()):
            names = {s.name for s in states} if shown is None else set(shown)
            names ^= {state.name}
            ui.viewport.show_objects(tuple(s.name for s in states if s.name in names))
        imgui.pop_style_color()
        imgui.same_line()
        words = state.name + ("  (keyframes move it)" if state.keyframed else "")
        imgui.align_text_to_frame_padding()
        selected = state.name == ui.selected
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*(ACCENT if selected else TEXT)))
        if imgui.selectable(words, selected)[0]:
            ui.selected = state.name
        imgui.pop_style_color()
        imgui.pop_id()


def _placement(ui: UiState, state: ObjectState) -> None:
    matrix = state.to_world.copy()
    part("position")
    changed, moved = imgui.drag_float3(
        "##position", [float(value) for value in matrix[:3, 3]], 0.005, format="%.3f m"
    )
    if changed:
        matrix[:3, 3] = moved
        ui.place(state, matrix)
    label("")
    words = PARTS["remove"]
    if button(f"{icons.ICON_FA_TRASH}  {words.name}", f"{words.about} (Delete)", width=-1.0):
        ui.remove()


def _material(ui: UiState, state: ObjectState) -> None:
    material = state.materials[0]
    if len(state.materials) > 1:
        quiet(f"It has {len(state.materials)} materials; a change here makes them one.")
    edited = _edited(material)
    if edited != material:
        ui.engine.paint(state.name, edited)
    if material.texture is not None:
        label("")
        words = PARTS["texture"]
        if button(words.name, words.about, width=-1.0):
            ui.engine.paint(state.name, replace(edited, texture=None))


def _edited(material: Material) -> Material:
    part("material")
    kind = choice("##kind", [labels.MATERIALS[kind] for kind in KINDS], KINDS.index(material.kind))
    if kind is not None:
        material = replace(material, kind=KINDS[kind])
    words = PARTS["reflectance" if material.kind == "conductor" else "albedo"]
    texture = " It multiplies the texture." if material.texture is not None else ""
    linear = ", ".join(f"{value:.3g}" for value in material.albedo)
    label(
        f"{words.name} (sRGB)",
        f"{words.about}{texture} Shown here as sRGB; scene.toml stores linear values: {linear}.",
    )
    color = linear_color("##color", material.albedo)
    hint(f"sRGB. scene.toml stores linear values: {linear}.")
    if color is not None:
        material = replace(material, albedo=color)
    with disabled(material.kind == "diffuse"):
        part("alpha")
        alpha = slider("##alpha", material.alpha, (0.0, 1.0), "{:.3f}".format)
        if alpha is not None:
            material = replace(material, alpha=round(alpha, 3))
    with disabled(material.kind != "plastic"):
        part("ior")
        ior = slider("##ior", material.ior, (MIN_IOR, MAX_IOR), "{:.2f}".format)
        if ior is not None:
            material = replace(material, ior=round(ior, 2))
    return material
