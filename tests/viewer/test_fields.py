"""Fields: what panels read and write is what the engine and the window have."""

from __future__ import annotations

from pathlib import Path
from queue import SimpleQueue

import numpy as np
import pytest
from PIL import Image

from iprt.errors import FormatError, IprtError
from iprt.geometry.material import Material
from iprt.scene.material_maps import MAPS
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from iprt.viewer.actions import actions
from iprt.viewer.controls import with_value
from iprt.viewer.fields import Field, lens_fields, look_fields, place_fields, view_field
from iprt.viewer.labels import TURNED
from iprt.viewer.material_fields import material_fields
from iprt.viewer.setting_fields import OWN, quality_field, rate_field
from iprt.viewer.virtual_light_fields import virtual_light_fields
from tests.scene.files import CUBE
from tests.viewer.viewports import Ui, until
from tests.waiting import DEADLINE_S


def by_key(fields: tuple[Field, ...]) -> dict[str, Field]:
    return {field.key: field for field in fields}


def test_what_is_written_is_read_again(ui: Ui) -> None:
    values = {
        "yaw": -12.5,
        "pitch": -20.0,
        "fov": 42.0,
        "exposure": 1.5,
        "curve": "filmic",
        "buffer": "depth",
        "against": "input",
        "split": 0.25,
        "error": True,
        "position": (0.5, -1.0, -2.0),
        "rotation": (10.0, -20.0, 30.0),
        "size": 0.75,
        "material": "conductor",
        "color": (0.25, 0.5, 0.75),
        "alpha": 0.5,
        "ior": 1.25,
        "metallic": 0.75,
        "transmission": 0.25,
        "clearcoat": 0.75,
        "clearcoat_alpha": 0.25,
        "sheen": (0.5, 0.25, 0.75),
        "sheen_alpha": 0.5,
        "tint": (0.75, 1.0, 0.5),
        "thin": True,
        "absorption": (0.5, 3.0, 7.0),
        "priority": 2,
        "opacity": 0.5,
        "cutoff": 0.25,
        **dict.fromkeys(MAPS, ""),  # they show the size of a map, not its file
        "emission": 12.5,
        "fps": 30,
    }
    fields = by_key(
        (
            *look_fields(ui),
            *lens_fields(ui),
            *place_fields(ui),
            *material_fields(ui),
            rate_field(ui),
        )
    )
    assert list(fields) == list(values)
    for key, value in values.items():
        before = {other: field.read() for other, field in fields.items() if other != key}
        fields[key].write(value)
        assert fields[key].read() == pytest.approx(value, abs=1e-4) or fields[key].read() == value
        assert {other: fields[other].read() for other in before} == before
        if fields[key].kind == "choice":
            assert value in fields[key].options()


def test_a_lamp_has_the_color_of_its_surface(ui: Ui) -> None:
    """White where that is black. Impossible brightness changes nothing."""
    fields = by_key(material_fields(ui))
    for albedo, expected in (((0.2, 0.4, 0.1), (2.5, 5.0, 1.25)), ((0.0, 0.0, 0.0), (5.0,) * 3)):
        fields["emission"].write(0.0)
        ui.selection.paint(albedo=albedo)
        fields["emission"].write(5.0)
        for impossible in (-1.0, float("nan"), float("inf"), 1e9):
            fields["emission"].write(impossible)
        assert ui.state is not None
        assert ui.state.materials[0].emission == pytest.approx(expected)


def test_glass_absorbs_no_impossible_share(ui: Ui) -> None:
    fields = by_key(material_fields(ui))
    fields["material"].write("dielectric")
    fields["absorption"].write((1.0, 2.0, 3.0))
    for impossible in (-1.0, float("nan"), float("inf"), 1e9):
        fields["absorption"].write((1.0, impossible, 3.0))
    assert fields["absorption"].read() == (1.0, 2.0, 3.0)
    assert all(fields[key].enabled() for key in ("thin", "absorption", "priority", "ior"))
    fields["material"].write("plastic")
    assert not any(fields[key].enabled() for key in ("thin", "absorption", "priority"))


def test_maps_are_given_by_file_taken_away_and_saved(ui: Ui) -> None:
    """Maps do not replace each other; an error names a missing file."""
    folder, fields = ui.engine.scene.root, by_key(material_fields(ui))
    pixels = np.random.default_rng(2).integers(0, 256, (3, 5, 4), np.uint8)
    Image.fromarray(pixels).save(folder / "map.png")
    fields["material"].write("principled")
    for key in MAPS:
        fields[key].write("map.png")
        assert "(5 x 3)" in fields[key].label().name
    assert ui.state is not None
    with pytest.raises(FormatError, match=r"gone\.png"):
        fields["texture"].write("gone.png")
    fields["normal_texture"].write(" ")
    material = ui.state.materials[0]
    gone = [key for key in MAPS if getattr(material, key) is None]
    assert gone == ["normal_texture"]
    done: SimpleQueue[str | None] = SimpleQueue()
    ui.engine.save(done.put)
    assert done.get(timeout=DEADLINE_S) is None
    saved = {entry.name: entry for entry in Scene.open(folder).objects}["cube"].bound.materials[0]
    assert saved == material
    np.testing.assert_array_equal(saved.surface_texture, material.surface_texture)
    assert not (folder / "textures" / "map.png").exists()


def test_a_resized_object_stands_where_it_stood(ui: Ui) -> None:
    size = by_key(place_fields(ui))["size"]

    def foot() -> tuple[np.ndarray, float]:
        state = ui.state
        assert state is not None
        low, high = state.corners
        middle = [0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])]
        sides = (high - low) * np.linalg.norm(state.to_world[:3, :3], axis=0)
        return state.to_world[:3, :3] @ middle + state.to_world[:3, 3], float(sides.max())

    before, longest = foot()
    size.write(3.0 * longest)
    after, now = foot()
    assert now == pytest.approx(3.0 * longest)
    np.testing.assert_allclose(after, before, atol=1e-9)
    for impossible in (0.0, -1.0, float("nan")):
        size.write(impossible)
        assert foot()[1] == now


def test_an_object_is_turned_and_scaled_about_its_shown_position(ui: Ui) -> None:
    """And is moved by it; all three are read as they were written, and saved without dirt."""
    fields = by_key(place_fields(ui))
    position, rotation, size = (fields[key] for key in ("position", "rotation", "size"))
    at = position.read()
    for angles in ((0.0, 90.0, 0.0), (-30.0, 120.0, 45.0), (90.0, 20.0, 0.0), (0.0, -90.0, 0.0)):
        rotation.write(angles)
        assert rotation.read() == pytest.approx(angles, abs=1e-3)
        assert position.read() == pytest.approx(at, abs=1e-4)
    size.write(0.5)
    assert size.read() == 0.5
    assert position.read() == pytest.approx(at, abs=1e-4)
    position.write((0.25, -0.5, -1.0))
    assert position.read() == (0.25, -0.5, -1.0)
    assert rotation.read() == pytest.approx((0.0, -90.0, 0.0))
    for impossible in (np.nan, np.inf):
        rotation.write((0.0, impossible, 0.0))
    assert rotation.read() == pytest.approx((0.0, -90.0, 0.0))
    done: SimpleQueue[str | None] = SimpleQueue()
    ui.engine.save(done.put)
    assert done.get(timeout=DEADLINE_S) is None
    text = (ui.engine.scene.root / "scene.toml").read_text()
    assert "e-" not in text.partition("to_world")[2]


def test_a_mesh_that_cannot_be_read_keeps_no_name(ui: Ui, tmp_path: Path) -> None:
    path = tmp_path / "thing.obj"
    path.write_text("v 1 2\nf 1 2 3\n")
    for _ in range(2):
        ui.add(path, 0.5, 0.6)
        assert ui.selected == "thing"
        until(ui.viewport, lambda _: "thing" not in ui.engine.editor._names)
        until(ui.viewport, lambda _: bool(ui.engine.status.problems))
    (problem,) = ui.engine.status.problems
    assert problem.startswith("thing.obj")
    assert str(tmp_path) not in problem
    path.write_text(CUBE)
    ui.add(path, 0.5, 0.6)
    until(ui.viewport, lambda _: ui.state is not None)
    assert ui.selected == "thing"
    with pytest.raises(IprtError, match="no such file"):
        ui.add(tmp_path / "lost.obj", 0.5, 0.6)


def test_only_what_counts_can_be_used(ui: Ui) -> None:
    material, lens = by_key(material_fields(ui)), by_key(lens_fields(ui))
    for kind, alpha, ior in (
        ("diffuse", False, False),
        ("conductor", True, False),
        ("plastic", True, True),
    ):
        material["material"].write(kind)
        assert (material["alpha"].enabled(), material["ior"].enabled()) == (alpha, ior)
    for against, error, split in ((None, False, False), ("input", False, True)):
        lens["against"].write(against)
        assert (lens["error"].enabled(), lens["split"].enabled()) == (against is not None, split)
        assert lens["error"].read() == error
    lens["error"].write(True)
    assert not lens["split"].enabled()
    assert {"truth", ui.settings.method} == set(lens["against"].missing())
    assert {"em", *lens["against"].missing()} < set(lens["against"].options())


def test_own_settings_and_views_have_a_name_while_they_are_shown(ui: Ui) -> None:
    quality, view = quality_field(ui), view_field(ui)
    ui.settings = Settings()
    quality.write("draft")
    assert (quality.read(), OWN in quality.options()) == ("draft", False)
    ui.settings = with_value(ui.settings, "atrous.levels", 4)
    assert (quality.read(), OWN in quality.options()) == (OWN, True)
    settings = ui.settings
    quality.write(OWN)
    assert ui.settings == settings
    view.write("ahead")
    assert (view.read(), list(view.options())) == ("ahead", ["ahead"])
    ui.viewport.turn(10.0, 0.0)
    assert (view.read(), list(view.options())) == (TURNED, ["ahead", TURNED])


def test_zero_frames_per_second_hold_none(ui: Ui) -> None:
    rate = rate_field(ui)
    rate.write(10)
    assert ui.viewport.motion.target_fps == 10.0
    rate.write(0)
    assert ui.viewport.motion.target_fps is None


def test_a_removed_object_is_not_selected_any_more(ui: Ui) -> None:
    ui.selection.remove()
    assert (ui.selected, ui.said) == (None, [("cube removed; Ctrl+Z brings it back", False)])
    ui.engine.undo()
    assert ui.state is None
    ui.selection.remove()
    assert len(ui.said) == 1


def test_what_undo_brings_back_is_selected(ui: Ui) -> None:
    do = actions(ui)
    ui.selection.remove()
    assert ui.selected is None
    do["undo"].act()
    assert ui.selected == "cube"
    do["redo"].act()
    assert ui.state is None
    do["undo"].act()
    ui.selected = None
    ui.engine.editor.paint({"cube": Material("diffuse", (0.1, 0.2, 0.3))})
    do["undo"].act()
    assert ui.selected is None


def test_a_place_where_nothing_can_be_is_refused(ui: Ui) -> None:
    by_key(place_fields(ui))["position"].write((np.inf, 0.0, 0.0))
    ((_, bad),) = ui.said
    assert bad
    assert ui.engine.world.edits == ()


# Lights without geometry ---------------------------------------------------------------------


def _shows_spot(ui: Ui) -> bool:
    """The mesh is of the displayed stage, while the rest of a state has all edits at once."""
    state = ui.state
    light = None if state is None else state.mesh.light
    return light is not None and light.cone_deg is not None


def test_a_light_is_added_changed_and_saved(ui: Ui) -> None:
    """As a user does: from a point to a spot, brighter, to one side; undone, and written."""
    ui.add_light()
    assert ui.selected == "point"
    until(ui.viewport, lambda _: ui.state is not None)
    light = by_key(virtual_light_fields(ui))
    assert light["light"].read() == "point"
    assert light["radius"].enabled()
    assert not light["inner"].enabled()
    light["power"].write(800.0)
    light["unit"].write("lumen")
    light["light color"].write((1.0, 0.5, 0.25))
    light["light"].write("spot")
    light["inner"].write(10.0)
    light["outer"].write(5.0)  # smaller than the inner angle: refused
    assert (light["inner"].read(), light["outer"].read()) == (10.0, 30.0)
    ui.engine.undo()  # changes in quick succession are one
    assert light["light"].read() == "point"
    ui.engine.redo()
    by_key(place_fields(ui))["position"].write((0.1, 0.2, -1.5))
    until(ui.viewport, lambda _: _shows_spot(ui))
    shown = ui.state
    assert shown is not None
    source = shown.mesh.light
    assert source is not None
    assert source.cone_deg == (10.0, 30.0)
    assert source.intensity[0] == 2.0 * source.intensity[1] == 4.0 * source.intensity[2] > 0.0
    done: SimpleQueue[str | None] = SimpleQueue()
    ui.engine.save(done.put)
    assert done.get(timeout=60.0) is None
    saved = Scene.open(ui.engine.scene.root)
    (written,) = (table for table in saved.manifest.objects if table.name == "point")
    assert written.light == shown.light
    assert written.to_world[3::4][:3] == [0.1, 0.2, -1.5]
    until(ui.viewport, lambda _: ui.state is not None and not ui.engine.unsaved)
    ui.selection.remove()
    until(ui.viewport, lambda _: [state.name for state in ui.engine.objects] == ["cube"])


def test_kinds_of_light_keep_what_they_share(ui: Ui) -> None:
    ui.add_light()
    until(ui.viewport, lambda _: ui.state is not None)
    light = by_key(virtual_light_fields(ui))
    light["power"].write(7.0)
    light["radius"].write(0.2)
    for kind in ("spot", "rectangle", "sun", "point"):
        light["light"].write(kind)
        assert light["light"].read() == kind
        assert light["power"].read() == 7.0
        assert light["unit"].read() in light["unit"].options()
    light["power"].write(-1.0)
    assert light["power"].read() == 7.0
    light["light"].write("sun")
    assert set(light["unit"].options()) == {"relative", "lux"}
