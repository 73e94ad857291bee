"""Light and reflections: found in the background, edited, saved, and told in words."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from iprt import cli
from iprt.device.compute import ComputeDevice
from iprt.errors import SceneError
from iprt.footage import found_light
from iprt.footage.found_gloss import search as gloss_search
from iprt.footage.frame import Frame
from iprt.footage.outside_light import OutsideLight, SunChoice
from iprt.footage.real_material import Evidence, GlossSearch, Plane, RealMaterial
from iprt.footage.sun import Sun
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.scene.light_edits import LightEdit, sun_table, towards
from iprt.scene.scene import Scene
from iprt.viewer.controls import Slider
from iprt.viewer.engine import Engine
from iprt.viewer.fields import Field
from iprt.viewer.light_fields import light_fields, sun_fields
from iprt.viewer.picking import Picking
from iprt.viewer.scene_light import SETTLED_S
from iprt.viewer.sun_arrow import ArrowPlace, SunArrow
from iprt.viewer.visible_surfaces import Surface
from tests.viewer.sunny import write_yard
from tests.viewer.test_fields import Ui
from tests.viewer.turns import Turns, turns
from tests.viewer.viewports import at_rest, until

FOUND = Sun(np.array([0.6, 0.8, 0.0]), (6.0, 5.0, 4.0), correlation=0.52)
HIGH = sun_table(towards(120.0, 60.0), (8.0, 7.0, 6.0), 2.0)
FLOOR = RealMaterial(
    "floor",
    Material("plastic", alpha=0.1, ior=1.5),
    plane=Plane((0.0, -1.3, 0.0), (0.0, 1.0, 0.0), 0.05),
    evidence=Evidence(12.0, 1.0, 0.1, 0.08, 0.12),
)


class Searches:
    """Stands for the searches in the footage: what they find, and when."""

    def __init__(self) -> None:
        self.sun: Sun | None = FOUND
        self.looked: list[SunChoice] = []
        self.free = threading.Event()
        self.free.set()

    def light(self, frame: Frame, choice: SunChoice, *, sky: bool) -> OutsideLight:
        self.free.wait()
        self.looked.append(choice)
        sun = self.sun if choice == "auto" else choice
        return OutsideLight(sun, doubt="" if sun or choice is None else "two directions fit")

    def gloss(self, *_: object) -> GlossSearch:
        self.free.wait()
        return GlossSearch((FLOOR,), ())


@pytest.fixture
def searches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Searches]:
    searches = Searches()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(found_light, "find_light", searches.light)
    monkeypatch.setattr(gloss_search, "find_gloss", searches.gloss)
    yield searches
    searches.free.set()


@pytest.fixture
def yard(tmp_path: Path, searches: Searches) -> Scene:
    return Scene.open(write_yard(tmp_path / "yard"))


def relit(driver: Turns, **parts: object) -> int:
    edit = LightEdit(**parts)  # type: ignore[arg-type]
    return driver.shared.edit(lambda world: replace(world, light=edit))


def staged(driver: Turns) -> Frame:
    stage = driver.core._staging.stage
    assert stage is not None
    return stage.frame


def shines(driver: Turns, sun: Sun) -> bool:
    """The frame that is rendered has this sun."""
    now = staged(driver).sun
    return (
        now is not None
        and np.allclose(now.direction, sun.direction)
        and now.irradiance == sun.irradiance
    )


def unsaved(driver: Turns) -> tuple[str, ...]:
    return driver.shared.world.unsaved


def later(driver: Turns) -> None:
    """When nothing was changed for a while, and what follows from it is done."""
    driver.clock.now += SETTLED_S
    driver.settle()


@pytest.mark.thorough
def test_an_edited_sun_is_shown_without_reading_the_video_again(
    yard: Scene, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It lights the object from where it is, and not where there is none."""
    with turns(yard, device) as driver:
        client = driver.join(view=View(48, 32, pitch_deg=-30.0))
        driver.answer(client)
        assert shines(driver, FOUND)
        np.testing.assert_array_equal(staged(driver).color, yard.frame().color)
        monkeypatch.setattr(Scene, "stream", None)
        pictures = []
        for yaw in (-90.0, 90.0):
            sun = sun_table(towards(yaw, 40.0), (30.0, 30.0, 30.0), 1.0)
            pictures.append(driver.answer(client, relit(driver, sun=sun)).picture.color)
            assert shines(driver, sun.sun)
        dark = driver.answer(client, relit(driver, sun="none")).picture.color
        assert staged(driver).sun is None
    left, right = pictures
    for one, other in ((left, right), (left, dark), (right, dark)):
        assert np.abs(one - other).max() > 0.1 * dark.mean()


def test_a_search_does_not_stop_the_picture(
    yard: Scene, device: ComputeDevice, searches: Searches
) -> None:
    """The status names the search, and the sun appears once it is found."""
    path = yard.root / "scene.toml"
    path.write_text(path.read_text().replace("fps", 'gloss = "declared"\nsun = "none"\nfps', 1))
    with turns(Scene.open(yard.root), device) as driver:
        client = driver.join()
        driver.answer(client)
        searches.free.clear()
        number = relit(driver, gloss="auto", sun="auto")
        driver.answer(client, number)
        told = "looking for glossy surfaces, the sun, the sky"
        driver.until(lambda: driver.shared.status.text == told)
        asked = driver.ask(client, view=View(32, 16, 10.0, -30.0))
        assert driver.answer(client, asked).request.view.yaw_deg == 10.0
        assert driver.shared.status.text == told
        assert staged(driver).sun is None
        searches.free.set()
        driver.settle()
        driver.until(lambda: staged(driver).gloss is not None)
        assert shines(driver, FOUND)
        assert staged(driver).real_materials == (FLOOR.material,)
        relit(driver, gloss="declared", sun="auto")
        driver.settle()
        driver.until(lambda: staged(driver).gloss is None)


def test_the_sky_is_estimated_for_a_sun_that_stays(
    yard: Scene, device: ComputeDevice, searches: Searches
) -> None:
    """Not for each on the way; none is looked for."""
    with turns(yard, device) as driver:
        driver.answer(driver.join())
        assert searches.looked == ["auto"]
        for yaw in range(5):
            relit(driver, sun=sun_table(towards(10.0 * yaw, 40.0), (1.0, 1.0, 1.0), 0.5))
            driver.settle()
        assert len(searches.looked) == 1
        later(driver)
        (choice,) = searches.looked[1:]
        assert isinstance(choice, Sun)
        np.testing.assert_allclose(choice.direction, towards(40.0, 40.0), atol=1e-3)
        relit(driver)
        later(driver)
        assert len(searches.looked) == 2, "results are kept"
        assert shines(driver, FOUND)


def test_light_is_saved_undone_and_read_again(yard: Scene, device: ComputeDevice) -> None:
    path = yard.root / "scene.toml"
    first = path.read_text()
    with turns(yard, device) as driver:
        shared, files = driver.shared, driver.core.files
        driver.answer(driver.join())
        relit(driver, sun=HIGH, sky="none")
        assert unsaved(driver) == ("sun", "sky")
        fed = driver.core.video.fed
        files.save()
        later(driver)
        assert unsaved(driver) == ()
        assert driver.core.video.fed is fed, "the video is not opened again"
        video = Scene.open(yard.root).manifest.video
        assert (video.sun, video.sky) == (HIGH, "none")
        saved = path.read_text()
        shared.undo()
        assert unsaved(driver) == ("sun", "sky")
        later(driver)
        assert shines(driver, FOUND)
        files.save()
        driver.settle()
        assert path.read_text() == first
        shared.redo()
        files.save()
        driver.settle()
        assert path.read_text() == saved
        # Changes by others count, and unsaved ones stay.
        relit(driver, sun=HIGH, sky="none", gloss="declared")
        path.write_text(first.replace("fps", 'sun = "none"\nfps', 1) + "# mine\n")
        driver.look_again()
        later(driver)
        assert shared.world.light == LightEdit(gloss="declared")
        assert staged(driver).sun is None
        files.save()
        driver.settle()
        video = Scene.open(yard.root).manifest.video
        assert (video.gloss, video.sun, video.sky) == ("declared", "none", "auto")
        assert path.read_text().endswith("# mine\n")


@pytest.fixture
def ui(yard: Scene, device: ComputeDevice) -> Iterator[Ui]:
    with Engine(yard, lambda: device) as engine:
        ui = Ui(engine)
        at_rest(ui.viewport)
        yield ui
        ui.viewport.close()


def by_key(fields: tuple[Field, ...]) -> dict[str, Field]:
    return {field.key: field for field in fields}


def test_what_is_written_is_read_again(ui: Ui) -> None:
    fields = by_key((*light_fields(ui), *sun_fields(ui)))
    values = {
        "gloss": False,
        "sky": False,
        "sun": "none",
        "arrow": True,
        "sun_yaw": 30.0,
        "sun_pitch": 40.0,
        "irradiance": 12.0,
        "sun_color": (1.0, 0.5, 0.25),
        "angle_deg": 1.5,
    }
    assert list(fields) == list(values)
    for key, value in values.items():
        field = fields[key]
        before = {other: fields[other].read() for other in fields if other not in (key, "sun")}
        field.write(value)
        assert field.read() == pytest.approx(value, abs=0.02), key
        if key == "sun":
            assert not fields["sun_yaw"].enabled()
            field.write("auto")
            continue
        after = {other: fields[other].read() for other in before}
        for other, kept in before.items():
            assert after[other] == pytest.approx(kept, abs=0.02), (key, other)
    assert fields["sun"].read() == "by hand"
    sun = ui.engine.sun
    assert sun is not None
    assert sun.irradiance == pytest.approx((12.0, 6.0, 3.0))
    assert ui.engine.unsaved == ("gloss", "sun", "sky")
    with pytest.raises(SceneError, match=r"^the sun: irradiance\[0\]: "):
        fields["irradiance"].write(-1.0)


def test_a_part_as_in_the_file_is_no_edit(ui: Ui) -> None:
    fields = by_key(light_fields(ui))
    for on in (False, True):
        fields["sky"].write(on)
        assert bool(ui.engine.unsaved) != on


def test_a_first_sun_comes_from_where_one_looks(ui: Ui) -> None:
    """As bright as the sliders reach."""
    sun = by_key(light_fields(ui))["sun"]
    sun.write("none")
    sun.write("by hand")
    assert ui.sun.direction == pytest.approx((0.0, 0.7071, -0.7071), abs=1e-3)
    slider = by_key(sun_fields(ui))["irradiance"].slider
    assert isinstance(slider, Slider)
    assert slider.low < max(ui.sun.irradiance) < slider.high


def test_the_sun_and_an_object_are_not_selected_together(ui: Ui) -> None:
    ui.selected = "cube"
    assert ui.arrow(ui.viewport.view) is None
    ui.select_sun(True)
    assert ui.state is None
    arrow = ui.arrow(ui.viewport.view)
    assert arrow is not None
    np.testing.assert_allclose(arrow.towards, FOUND.direction)
    assert arrow.point[1] == pytest.approx(-1.3, abs=0.05), "the floor in the middle"
    ui.selected = "cube"
    assert not ui.selection.sun


def test_words_are_those_of_the_scene_report(ui: Ui, capsys: pytest.CaptureFixture[str]) -> None:
    folder = ui.engine.scene.root

    def reported() -> list[str]:
        assert cli.main(["scene", "info", str(folder)]) == 0
        lines = capsys.readouterr().out.splitlines()
        return [x for x in lines if x.split("  ")[0] in ("sun", "no sun", "sky", "glossy")]

    def told() -> list[str]:
        return [f"{name:<10} {words}" for name, words in ui.engine.light_lines]

    until(ui.viewport, lambda _: bool(told()))
    assert len(told()) == 2
    assert told() == reported()
    ui.engine.set_light(LightEdit(sun=HIGH))
    assert "declared" in told()[0]
    ui.save()
    until(ui.viewport, lambda _: not ui.engine.unsaved)
    assert told() == reported()
    ui.engine.set_light(LightEdit(sun="none", gloss="declared"))
    until(ui.viewport, lambda _: not told())


@pytest.mark.thorough
def test_highlights_show_the_glossy_surfaces_that_were_found(ui: Ui) -> None:
    """The buffer of reflections is bright on the found floor, and black where there is none."""
    ui.viewport.lens = replace(ui.viewport.lens, buffer="highlight")
    shown = at_rest(ui.viewport).shown
    assert shown.picture.aovs["highlight"].max() > 0.0
    ui.engine.set_light(LightEdit(gloss="declared"))
    until(
        ui.viewport,
        lambda s: s.shown.refined and not s.shown.picture.aovs.get("highlight", np.ones(1)).any(),
    )


# The arrow ------------------------------------------------------------------------------------


def test_the_arrow_is_drawn_along_the_light() -> None:
    view, centre = View(200, 100, 20.0, -10.0, 60.0), np.array([1.0, 2.0, 3.0])
    point = centre - 3.0 * view.world_from_view[:, 2]
    arrow = SunArrow(point, np.array(towards(-40.0, 50.0)), 0.5)
    drawn = arrow.drawn(view, centre)
    assert drawn is not None
    np.testing.assert_allclose(drawn[1], (100.0, 50.0), atol=1e-9)
    end = view.project(point + 0.5 * arrow.towards - centre)
    np.testing.assert_allclose(drawn[0], end, atol=1e-9)
    assert drawn[0, 0] < 100.0
    assert drawn[0, 1] < 50.0
    turn = arrow.turn
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    np.testing.assert_allclose(turn[:, 1], arrow.towards)
    behind = SunArrow(centre + view.world_from_view[:, 2], arrow.towards, 0.5)
    assert behind.drawn(view, centre) is None


def test_the_arrow_stays_where_it_points_while_the_view_turns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Until it would leave the picture; where no surface is known it is in the middle."""
    place, picking, centre, up = ArrowPlace(), Picking(), np.zeros(3), np.array([0.0, 1.0, 0.0])
    view = View(100, 100, fov_y_deg=60.0)
    np.testing.assert_allclose(place.arrow(picking, view, centre, up).point, (0.0, 0.0, -2.0))
    spot = np.array([0.0, -0.2, -4.0])
    seen = Surface(4.0, spot, up)
    monkeypatch.setattr(Picking, "ground", lambda *_: seen)
    assert place.arrow(picking, view, centre, up).point is spot
    seen = Surface(4.0, np.array([4.0, 0.0, 0.0]), up)
    assert place.arrow(picking, View(100, 100, 15.0, fov_y_deg=60.0), centre, up).point is spot
    turned = place.arrow(picking, View(100, 100, 80.0, fov_y_deg=60.0), centre, up)
    assert turned.point is seen.point
    assert turned.length == pytest.approx(0.5 * np.tan(np.deg2rad(30.0)) * 4.0)
