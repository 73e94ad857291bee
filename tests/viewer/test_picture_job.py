"""Pictures under way: abandoned when others are wanted; told while compilers work; and no leaks."""

from __future__ import annotations

import gc
import threading
import weakref
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from iprt.device import compute as module
from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.renderer import Renderer
from iprt.scene.light_edits import LightEdit
from iprt.scene.mesh_pose import MeshPose
from iprt.scene.object_edits import ObjectEdit
from iprt.scene.scene import Scene
from iprt.viewer.plain_video import PlainFrame
from iprt.viewer.state import Status
from tests.viewer.turns import FEWEST, SETTINGS, VIEW, Turns, turns

HEAVY = SETTINGS.model_copy(
    update={"trace": SETTINGS.trace.model_copy(update={"rays": SETTINGS.trace.rays + 1})}
)


class Meanwhile:
    """Something happens while a picture is rendered: as its kernel `composite` is launched."""

    def __init__(self, driver: Turns, monkeypatch: pytest.MonkeyPatch) -> None:
        self.do: list[Callable[[], object]] = []
        self.finished = 0
        # Every launch is one between which the engine looks, and every picture takes long.
        monkeypatch.setattr("iprt.viewer.picture_job.ABANDON_S", 0.0)
        monkeypatch.setattr("iprt.device.bands.QUICK_S", -1.0)
        launch = module.Kernel.__call__

        def noting(kernel: module.Kernel, *args: object, **named: object) -> None:
            if kernel.name == "composite" and self.do:
                self.do.pop(0)()
            launch(kernel, *args, **named)  # type: ignore[arg-type]
            self.finished += kernel.name == "composite"

        monkeypatch.setattr(module.Kernel, "__call__", noting)


@pytest.mark.thorough
def test_what_is_not_wanted_any_more_is_abandoned(
    scene: Scene, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For other settings, sizes, materials; the next picture is as if there had been no other."""
    green = ObjectEdit("cube", material=Material("plastic", (0.1, 0.6, 0.1)))
    with turns(scene, device) as driver:
        client = driver.join()
        first = driver.answer(client)
        changes: list[Callable[[], int]] = [
            lambda: driver.change(settings=SETTINGS),
            lambda: driver.ask(client, view=VIEW.resized(16, 8)),
            lambda: driver.change(edits=(green,)),
        ]
        for change in changes:
            meanwhile = Meanwhile(driver, monkeypatch)
            numbers: list[int] = []
            meanwhile.do.append(lambda change=change, made=numbers: made.append(change()))
            driver.change(settings=HEAVY)
            assert driver.core.turn()
            assert meanwhile.finished == 0
            assert driver.shown(client) is not None
            shown = driver.answer(client, numbers[0])
            assert driver.shared.status.problems == ()
            monkeypatch.undo()
            driver.change(settings=SETTINGS, edits=())
            driver.answer(client, driver.ask(client))
        again = driver.shown(client)
    assert shown.request is not None
    np.testing.assert_array_equal(again.picture.color, first.picture.color)


def test_what_can_follow_is_finished(
    scene: Scene, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Or else who drags the camera, or an object, would see nothing."""
    with turns(scene, device) as driver:
        client = driver.join()
        driver.answer(client)
        meanwhile = Meanwhile(driver, monkeypatch)
        turned = replace(VIEW, yaw_deg=3.0)
        meanwhile.do.append(lambda: driver.ask(client, view=replace(VIEW, yaw_deg=9.0)))
        number = driver.ask(client, view=turned)
        assert driver.core.turn()
        assert driver.shown(client).number >= number
        assert driver.shown(client).request.view == turned


@pytest.mark.thorough
def test_who_drags_a_slider_sees_pictures(
    scene: Scene, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each picture that is abandoned leaves more time to the next."""
    now = [0.0]
    with turns(scene, device, FEWEST) as driver:
        client = driver.join()
        driver.answer(client)
        meanwhile = Meanwhile(driver, monkeypatch)
        monkeypatch.setattr("iprt.viewer.picture_job.ABANDON_S", 0.25)
        monkeypatch.setattr("iprt.viewer.picture_job.time.perf_counter", lambda: now[0])

        def drag(number: int) -> None:
            now[0] += 2.0  # each picture takes so long
            material = Material("plastic", (0.01 * number, 0.5, 0.5))
            driver.change(edits=(ObjectEdit("cube", material=material),))

        meanwhile.do += [lambda number=number: drag(number) for number in range(1, 13)]
        drag(0)
        for _ in range(12):
            driver.core.turn()
        assert meanwhile.finished == 2


def test_the_first_picture_is_the_video(scene: Scene, device: ComputeDevice) -> None:
    """At once, while kernels compile, which are counted to the last; then the picture."""
    own = ComputeDevice(device.device)
    told: list[Status] = []
    pictures: list[object] = []
    with turns(scene, own) as driver:
        shared = driver.shared
        report, publish = shared.report, shared.publish
        shared.report = lambda s: (told.append(s), report(s))[1]  # type: ignore[method-assign]
        shared.publish = (  # type: ignore[method-assign]
            lambda client, shown: (pictures.append(shown), publish(client, shown))[1]
        )
        client = driver.join(frames=2)
        shown = driver.answer(client)
        video, *others = pictures
        assert video.plain  # type: ignore[attr-defined]
        assert others == [shown]
        assert not shown.plain
        counts = [(s.built, s.to_build) for s in told if s.doing == "compiling"]
        last = counts[-1][1]
        assert last > 20
        assert counts[-1] == (last, last)
        assert {total for _, total in counts} == {last}
        assert [built for built, _ in counts] == sorted({built for built, _ in counts})
        assert f"compiling 3 of {last}" in {s.text for s in told}
        # Where all is compiled, nothing is told and the picture is not the video again.
        told.clear()
        driver.answer(client, driver.ask(client, view=VIEW.resized(20, 10)))
        assert "compiling" not in {s.doing for s in told}
        assert [p.plain for p in pictures] == [True, *[False] * (len(pictures) - 1)]  # type: ignore[attr-defined]
    assert video.request.view == VIEW  # type: ignore[attr-defined]


def test_the_video_is_there_before_its_light_is_found(
    scene: Scene, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each requested view shows it during the search."""
    found, relit = threading.Event(), Scene.relit

    def search(scene: Scene, edit: LightEdit) -> Scene:
        found.wait()
        return relit(scene, edit)

    def sees(driver: Turns, client: int, view: View) -> bool:
        shown = driver.shared.shown(client)
        return shown is not None and shown.request.view == view

    monkeypatch.setattr(Scene, "relit", search)
    whole = PlainFrame.of(scene.frame())
    with turns(scene, device, FEWEST) as driver:
        try:
            client = driver.join()
            for view in (VIEW, replace(VIEW, yaw_deg=50.0)):
                driver.ask(client, view=view)
                driver.until(lambda view=view: sees(driver, client, view))
                shown = driver.shown(client)
                assert shown.plain
                np.testing.assert_array_equal(shown.picture.color, whole.seen(view))
            assert driver.shared.status.text.startswith("looking for")
        finally:
            found.set()
        assert not driver.answer(client).plain


def test_the_plain_video_is_what_renderers_resample(scene: Scene, device: ComputeDevice) -> None:
    frame = scene.frame()
    for view in (VIEW, replace(VIEW, yaw_deg=178.0), replace(VIEW, projection="equirect")):
        with Renderer(device, frame, (), view, SETTINGS) as renderer:
            expected = renderer.render().color
        found = PlainFrame.of(frame).seen(view)
        assert found.shape == expected.shape
        # Where colors change from texel to texel, the two filters differ.
        assert np.median(np.abs(found - expected)) < 0.02 * np.median(expected)


def test_what_a_mesh_file_lost_is_told(scene: Scene, device: ComputeDevice, tmp_path: Path) -> None:
    path = tmp_path / "shining.obj"
    path.write_text(
        "mtllib shining.mtl\nmtllib lost.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl lamp\nf 1 2 3\n"
    )
    (tmp_path / "shining.mtl").write_text("newmtl lamp\nKd 1 1 1\nPc 0.5\n")
    with turns(scene, device) as driver:
        driver.answer(driver.join())
        driver.core.add(ObjectEdit("shining", path=path), (20.0, -40.0), MeshPose(height_m=0.3))
        driver.settle()
        (note,) = driver.shared.status.notes
        assert note.startswith("shining.obj: ")
        assert "refers to lost.mtl, which is missing" in note
        assert "not read: 'pc' of its materials" in note
        assert driver.shared.status.problems == ()
        driver.clock.now += 100.0
        driver.settle()
        assert driver.shared.status.notes == ()


@pytest.mark.thorough
def test_renderers_and_programs_do_not_pile_up(
    scene: Scene, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only the last few of all that settings, sizes, objects and views have needed are held."""
    renderers: list[weakref.ref[Renderer]] = []

    def noting(*args: object, **kwargs: object) -> Renderer:
        made = Renderer(*args, **kwargs)  # type: ignore[arg-type]
        renderers.append(weakref.ref(made))
        return made

    monkeypatch.setattr("iprt.viewer.accumulating_renderer.Renderer", noting)
    monkeypatch.setattr("iprt.viewer.core.MOST_PROGRAMS", 8)
    own = ComputeDevice(device.device)
    with turns(scene, own) as driver:
        client = driver.join()
        driver.answer(client)
        for number in range(5):
            driver.change(settings=(SETTINGS, HEAVY)[number % 2])
            driver.ask(client, view=VIEW.resized(16 + 4 * number, 8))
            driver.settle()
            driver.ask(client, settings=SETTINGS.model_copy(update={"method": "ibl"}))
            driver.settle()
            gc.collect()
            alive = [ref for ref in renderers if ref() is not None]
            assert len(alive) <= 2
        in_use = len(own.built_programs)
        driver.shared.leave(client)
        driver.settle()
        gc.collect()
        assert not [ref for ref in renderers if ref() is not None]
        own.kernel("compositing/composite.cl", "composite", {"VARIANT": 5})
        assert len(own.built_programs) <= 8 < in_use
    assert len(renderers) > 5
