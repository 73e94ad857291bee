"""The panel of the scene: its views, its objects, and the one that is selected."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.scene.material import Material, MaterialKind
from iprt.viewer.desktop.desk import Desk
from iprt.viewer.desktop.style import ACCENT, TEXT
from iprt.viewer.desktop.widgets import (
    button,
    choice,
    disabled,
    heading,
    hint,
    label,
    linear_color,
    quiet,
)
from iprt.viewer.objects import ObjectState
from iprt.viewer.viewport import MAX_FOV_DEG, MIN_FOV_DEG

KINDS: tuple[MaterialKind, ...] = get_args(MaterialKind)
MAX_IOR = 3.0
"""Of the slider."""


def draw(desk: Desk) -> None:
    """The whole panel."""
    _files(desk)
    heading("View")
    _view(desk)
    heading("Objects")
    _objects(desk)
    state = desk.state
    if state is not None:
        heading(state.name)
        _placement(desk, state)
        _material(desk, state)


def _files(desk: Desk) -> None:
    third = (imgui.get_content_region_avail().x - 2.0 * imgui.get_style().item_spacing.x) / 3.0
    if button(f"{icons.ICON_FA_PLUS}  Add mesh", "A; or drop a file on the picture", width=third):
        desk.browsing = True
    imgui.same_line()
    if button(f"{icons.ICON_FA_FLOPPY_DISK}  Save", "Ctrl+S", width=third, enabled=desk.unsaved):
        desk.save()
    imgui.same_line()
    half = 0.5 * (third - imgui.get_style().item_spacing.x)
    if button(icons.ICON_FA_ROTATE_LEFT, "Undo (Ctrl+Z)", width=half):
        desk.undo()
    imgui.same_line()
    if button(icons.ICON_FA_ROTATE_RIGHT, "Redo (Ctrl+Y)", width=half):
        desk.redo()


def _view(desk: Desk) -> None:
    viewport = desk.viewport
    names = list(desk.engine.scene.views)
    if names:
        label("view", "Views of scene.toml; each shows the objects that it names.")
        # Another scene.toml may lack the view by now.
        known = viewport.name is not None and viewport.name in names
        panorama = viewport.view.projection == "equirect"
        shown = names if known else [*names, "(panorama)" if panorama else "(turned)"]
        chosen = choice("##view", shown, shown.index(viewport.name or "") if known else len(names))
        if chosen is not None and chosen < len(names):
            viewport.go_to(names[chosen])
    view = viewport.view
    if view.projection == "equirect":
        quiet("The whole panorama: choose a view to look around.")
        return
    label("yaw, pitch", "Degrees right and up. Drag the picture to look around.")
    changed, (yaw, pitch) = imgui.drag_float2(
        "##direction", [view.yaw_deg, view.pitch_deg], 0.25, -180.0, 180.0, "%.2f°", _CLAMPED
    )
    if changed:
        viewport.look(replace(view, yaw_deg=yaw, pitch_deg=min(max(pitch, -90.0), 90.0)))
    label("field of view", "Vertical. The mouse's wheel changes it.")
    changed, fov = imgui.slider_float(
        "##fov", view.fov_y_deg, MIN_FOV_DEG, MAX_FOV_DEG, "%.1f°", _CLAMPED
    )
    if changed:
        viewport.look(replace(view, fov_y_deg=fov))


_CLAMPED = imgui.SliderFlags_.always_clamp


def _objects(desk: Desk) -> None:
    states, shown = desk.engine.objects, desk.viewport.objects
    if not states:
        quiet("None yet: drop a .glb, .gltf, .obj or .ply file on the picture.")
    for state in states:
        visible = shown is None or state.name in shown
        imgui.push_id(state.name)
        icon = icons.ICON_FA_EYE if visible else icons.ICON_FA_EYE_SLASH
        imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(0, 0, 0, 0))
        if button(icon, "Show or hide it here", width=2.0 * imgui.get_font_size()):
            names = {s.name for s in states} if shown is None else set(shown)
            names ^= {state.name}
            desk.viewport.show_objects(tuple(s.name for s in states if s.name in names))
        imgui.pop_style_color()
        imgui.same_line()
        words = state.name + ("  (keyframes move it)" if state.keyframed else "")
        imgui.align_text_to_frame_padding()
        selected = state.name == desk.selected
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*(ACCENT if selected else TEXT)))
        if imgui.selectable(words, selected)[0]:
            desk.selected = state.name
        imgui.pop_style_color()
        imgui.pop_id()


def _placement(desk: Desk, state: ObjectState) -> None:
    matrix = desk.placement(state).copy()
    label("position", "Metres, in the world: x right, y up, z back.")
    changed, moved = imgui.drag_float3(
        "##position", [float(value) for value in matrix[:3, 3]], 0.005, format="%.3f"
    )
    if changed:
        matrix[:3, 3] = moved
        desk.place(state, matrix)
    label("")
    if button(f"{icons.ICON_FA_TRASH}  Remove", "Delete", width=-1.0):
        desk.remove()


def _material(desk: Desk, state: ObjectState) -> None:
    material = state.materials[0]
    if len(state.materials) > 1:
        quiet(f"It has {len(state.materials)} materials; a change here makes them one.")
    edited = _edited(material)
    if edited != material:
        desk.engine.paint(state.name, edited)
    if material.texture is not None:
        label("")
        about = "Textures of mesh files, and of all but diffuse materials, cannot be saved."
        if button("Without its texture", about, width=-1.0):
            desk.engine.paint(state.name, replace(edited, texture=None))


def _edited(material: Material) -> Material:
    label("material")
    kind = choice("##kind", KINDS, KINDS.index(material.kind))
    if kind is not None:
        material = replace(material, kind=KINDS[kind])
    conductor = material.kind == "conductor"
    textured = material.texture is not None
    label("reflectance" if conductor else "albedo", "Linear; shown as it looks.")
    color = linear_color("##color", material.albedo)
    if textured:
        hint("Multiplies its texture.")
    if color is not None:
        material = replace(material, albedo=color)
    with disabled(material.kind == "diffuse"):
        label("roughness", "GGX alpha; a metal of 0 is a mirror.")
        changed, alpha = imgui.slider_float("##alpha", material.alpha, 0.0, 1.0, "%.3f", _CLAMPED)
        if changed:
            material = replace(material, alpha=round(alpha, 4))
    if material.kind == "plastic":
        label("index of refraction", "Of the coat.")
        changed, ior = imgui.slider_float("##ior", material.ior, 1.01, MAX_IOR, "%.2f", _CLAMPED)
        if changed:
            material = replace(material, ior=round(ior, 3))
    return material
