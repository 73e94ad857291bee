"""The panel of the scene: its views, its objects, and the selected object."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.viewer.desktop.style import ACCENT, TEXT
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.widgets import button, draw_field, heading, label, quiet, slider
from iprt.viewer.fields import material_fields, place_fields, view_field
from iprt.viewer.labels import PARTS
from iprt.viewer.objects import ObjectState
from iprt.viewer.viewport import MAX_FOV_DEG, MIN_FOV_DEG


def draw(ui: DesktopState) -> None:
    """Draw the panel."""
    _files(ui)
    heading("View")
    _view(ui)
    heading(PARTS["objects"].name)
    _objects(ui)
    state = ui.state
    if state is not None:
        heading(state.name)
        _selected(ui, state)


def _files(ui: DesktopState) -> None:
    engine, gap = ui.engine, imgui.get_style().item_spacing.x
    third = (imgui.get_content_region_avail().x - 2.0 * gap) / 3.0
    half = 0.5 * (third - gap)
    for name, icon, key, wide, enabled, act in (
        ("add", f"{icons.ICON_FA_PLUS}  Add mesh", "A", third, True, ui.browse),
        ("save", f"{icons.ICON_FA_FLOPPY_DISK}  Save", "Ctrl+S", third, ui.unsaved, ui.save),
        ("undo", icons.ICON_FA_ROTATE_LEFT, "Ctrl+Z", half, engine.can_undo, engine.undo),
        ("redo", icons.ICON_FA_ROTATE_RIGHT, "Ctrl+Y", half, engine.can_redo, engine.redo),
    ):
        words = PARTS[name]
        about = f"{words.name} ({key}). {words.about}"
        if button(f"{icon}##{name}", about, width=wide, enabled=enabled):
            act()
        imgui.same_line()
    imgui.new_line()


def _view(ui: DesktopState) -> None:
    viewport = ui.viewport
    if ui.engine.scene.views:
        draw_field(ui, view_field(ui))
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


def _objects(ui: DesktopState) -> None:
    states = ui.engine.objects
    if not states and ui.displayed is not None:  # before the first picture they are still loading
        quiet("None yet: drop a .glb, .gltf, .obj, .ply or .stl file on the picture.")
    for state in states:
        visible = ui.visible(state.name)
        imgui.push_id(state.name)
        icon = icons.ICON_FA_EYE if visible else icons.ICON_FA_EYE_SLASH
        imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(0, 0, 0, 0))
        if button(icon, "Show or hide it here", width=2.0 * imgui.get_font_size()):
            ui.show(state.name, not visible)
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


def _selected(ui: DesktopState, state: ObjectState) -> None:
    for field in place_fields(ui):
        draw_field(ui, field)
    label("")
    words = PARTS["remove"]
    if button(f"{icons.ICON_FA_TRASH}  {words.name}", f"{words.about} (Delete)", width=-1.0):
        ui.remove()
    if len(state.materials) > 1:
        quiet(f"It has {len(state.materials)} materials; a change here makes them one.")
    for field in material_fields(ui):
        draw_field(ui, field)
    if state.materials[0].texture is not None:
        label("")
        words = PARTS["texture"]
        if button(words.name, words.about, width=-1.0):
            ui.paint(texture=None)
