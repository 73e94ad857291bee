"""The panels of the scene, its light and the picture."""

from __future__ import annotations

from functools import partial

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.viewer.actions import Action, actions
from iprt.viewer.arranging_fields import array_fields, group_field, name_field, step_fields
from iprt.viewer.desktop import looking_panel, views
from iprt.viewer.desktop.style import ACCENT, QUIET, TEXT
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.widgets import (
    action_button,
    button,
    draw_field,
    heading,
    label,
    quiet,
)
from iprt.viewer.fields import (
    lens_fields,
    look_fields,
    place_fields,
    view_field,
)
from iprt.viewer.labels import PARTS, Label
from iprt.viewer.light_fields import light_fields, sun_fields
from iprt.viewer.material_fields import material_fields
from iprt.viewer.virtual_light_fields import virtual_light_fields

ARRANGING = (
    ("duplicate", icons.ICON_FA_CLONE),
    ("settle", icons.ICON_FA_ARROWS_DOWN_TO_LINE),
    ("group", icons.ICON_FA_OBJECT_GROUP),
    ("ungroup", icons.ICON_FA_OBJECT_UNGROUP),
    ("lock", icons.ICON_FA_LOCK),
    ("remove", icons.ICON_FA_TRASH),
)
"""Actions on the selected objects, with their icons."""
LOCK_EM = 2.6
"""Room for the lock at the end of a row."""


def scene(ui: DesktopState) -> None:
    """Draw the panel of views and objects."""
    _files(ui)
    heading("View")
    _view(ui)
    heading(PARTS["objects"].name)
    _objects(ui)
    if ui.state is not None:
        others = len(ui.selection.names) - 1
        heading(f"{ui.state.name}{f' and {others} more' if others else ''}")
        _selected(ui)


def light(ui: DesktopState) -> None:
    """Draw the panel of light and reflections."""
    heading("Found in the footage")
    for field in light_fields(ui):
        draw_field(ui, field)
    heading(PARTS["sun"].name)
    for field in sun_fields(ui):
        draw_field(ui, field)
    heading("In words")
    for name, words in ui.engine.light_lines:
        quiet(f"{name}: {words}")


def picture(ui: DesktopState) -> None:
    """Draw the panel of the lens, comparisons and screenshots."""
    heading("Picture")
    for field in lens_fields(ui):
        draw_field(ui, field)
    looking_panel.draw(ui)
    heading(PARTS["screenshot"].name)
    half = 0.5 * (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x)
    for kind, keys in (("PNG", "F12"), ("EXR", "Shift+F12")):
        words = Label(kind, PARTS["screenshot"].about)
        act = partial(ui.screenshot, f".{kind.lower()}")
        action_button(Action(kind, words, act, keys), icons.ICON_FA_CAMERA, width=half)
        imgui.same_line()
    imgui.new_line()
    quiet(f"to {ui.folder}")


def _files(ui: DesktopState) -> None:
    gap, shared = imgui.get_style().item_spacing.x, actions(ui)
    third = (imgui.get_content_region_avail().x - 2.0 * gap) / 3.0
    half = 0.5 * (third - gap)
    add = Action("add", PARTS["add"], ui.browse, "A")
    for action, icon, width in (
        (add, icons.ICON_FA_PLUS, half),
        (shared["light"], icons.ICON_FA_LIGHTBULB, half),
        (shared["save"], icons.ICON_FA_FLOPPY_DISK, third),
        (shared["undo"], icons.ICON_FA_ROTATE_LEFT, half),
        (shared["redo"], icons.ICON_FA_ROTATE_RIGHT, half),
    ):
        action_button(action, icon, width=width, short=width == half)
        imgui.same_line()
    imgui.new_line()


def _view(ui: DesktopState) -> None:
    viewport = ui.viewport
    if ui.engine.views:
        draw_field(ui, view_field(ui))
    views.draw(ui)
    if viewport.view.projection == "equirect":
        quiet("The whole panorama: choose a view to look around.")
        return
    for field in look_fields(ui):
        draw_field(ui, field)


def _objects(ui: DesktopState) -> None:
    states = ui.engine.objects
    if not states and ui.displayed is not None:  # before the first picture they are still loading
        quiet("None yet: drop a .glb, .gltf, .obj, .ply, .stl or .usd file on the picture.")
    for state in states:
        imgui.push_id(state.name)
        visible = ui.visible(state.name)
        if _bare_button(icons.ICON_FA_EYE if visible else icons.ICON_FA_EYE_SLASH, "Show or hide"):
            ui.show([state.name], not visible)
        imgui.same_line()
        now = state.edited(ui.engine.world.edit_of(state.name)) or state
        notes = [*([now.group] if now.group else []), *(["moves"] if now.keyframed else [])]
        words = f"{state.name}  ({', '.join(notes)})" if notes else state.name
        imgui.align_text_to_frame_padding()
        selected = state.name in ui.selection.names
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*(ACCENT if selected else TEXT)))
        room = imgui.get_content_region_avail().x - LOCK_EM * imgui.get_font_size()
        if imgui.selectable(words, selected, 0, imgui.ImVec2(room, 0.0))[0]:
            ui.pick(state.name, more=imgui.get_io().key_ctrl)
        imgui.pop_style_color()
        imgui.same_line()
        icon = icons.ICON_FA_LOCK if now.locked else icons.ICON_FA_LOCK_OPEN
        if _bare_button(icon, PARTS["lock"].about, dim=not now.locked):
            ui.engine.editor.lock([state.name], not now.locked)
        imgui.pop_id()


def _bare_button(icon: str, about: str, *, dim: bool = False) -> bool:
    """Draw an icon that is a button; return True if it was pressed."""
    imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(0, 0, 0, 0))
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*(QUIET if dim else TEXT)))
    pressed = button(icon, about, width=2.0 * imgui.get_font_size())
    imgui.pop_style_color(2)
    return pressed


def _selected(ui: DesktopState) -> None:
    shared, state = actions(ui), ui.state
    assert state is not None
    gap = imgui.get_style().item_spacing.x
    width = (imgui.get_content_region_avail().x - gap * (len(ARRANGING) - 1)) / len(ARRANGING)
    for name, icon in ARRANGING:
        action_button(shared[name], icon, width=width, short=True)
        imgui.same_line()
    imgui.new_line()
    if ui.renaming:
        imgui.set_keyboard_focus_here(1)  # past the label
        ui.renaming = False
    draw_field(ui, name_field(ui))
    for field in place_fields(ui):
        draw_field(ui, field)
    if imgui.tree_node(f"{PARTS['stepped'].name}, {PARTS['array'].name.lower()}"):
        for field in (*step_fields(ui), *array_fields(ui), group_field(ui)):
            draw_field(ui, field)
        label("")
        action_button(shared["array"], icons.ICON_FA_CLONE, width=-1.0)
        imgui.tree_pop()
    if len(state.materials) > 1:
        quiet(f"It has {len(state.materials)} materials; a change here makes them one.")
    for field in material_fields(ui) if state.light is None else virtual_light_fields(ui):
        if field.enabled():  # rows that come and go are below the ones that decide
            draw_field(ui, field)
    if shared["bare"].visible():
        label("")
        action_button(shared["bare"], "", width=-1.0)
