"""The engine's turns: what is newest is seen, what is at rest is refined, nothing piles up."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.film import footage_of
from iprt.footage.frame import Frame
from iprt.footage.video.stream import Ahead
from iprt.geometry.material import Material
from iprt.renderer import RenderedFrame, Renderer
from iprt.scene.object_edits import ObjectEdit, flat
from iprt.scene.scene import Scene
from iprt.viewer.state import Playback
from tests.clips import write_clip
from tests.viewer.turns import SETTINGS, VIEW, Turns, turns

CLIP_FRAMES = 12

STILL = SETTINGS.model_copy(update={"fading": 0.0})


def renderer_of(scene: Scene, device: ComputeDevice, **options: object) -> Renderer:
    """A renderer of the state in which a viewer opens."""
    given = {"view": VIEW, "settings": STILL, "instances": scene.instances, **options}
    frame = scene.frame()
    footage = footage_of(scene, frame, SETTINGS)
    return Renderer(device, frame, footage=footage, **given)  # type: ignore[arg-type]


@pytest.mark.thorough
def test_a_picture_at_rest_is_refined_to_that_of_a_still(
    scene: Scene, device: ComputeDevice
) -> None:
    with turns(scene, device) as driver:
        client = driver.join(frames=13)
        driver.answer(client)
        driver.settle()
        shown = driver.shown(client)
        driver.settle()
        assert driver.shown(client) is shown
    with renderer_of(scene, device) as renderer:
        expected = renderer.render(13).color
    assert np.array_equal(shown.picture.color, expected)
    assert (shown.frames, shown.step, shown.refined) == (13, 13, True)
    assert shown.noise is not None
    assert {"composite", "temporal"} <= {entry.name for entry in shown.passes}


def test_the_newest_look_wins(scene: Scene, device: ComputeDevice) -> None:
    """A burst of looks costs one picture, that of the last one, as if there had been no other."""
    with turns(scene, device) as driver:
        client = driver.join(frames=3)
        driver.answer(client)
        driver.settle()
        before = driver.shown(client)
        looks = [replace(VIEW, yaw_deg=0.3 * number) for number in range(1, 101)]
        numbers = [driver.ask(client, view=look, frames=3) for look in looks]
        shown = driver.answer(client, numbers[-1])
    assert shown.step == before.step + 1
    assert shown.frames == 1
    assert shown.request.view == looks[-1]
    with renderer_of(scene, device) as renderer:
        renderer.render(3)
        renderer.look(looks[-1])
        renderer.fading = SETTINGS.fading
        expected = renderer.render(1).color
    assert np.array_equal(shown.picture.color, expected)


def test_what_was_blurred_in_motion_goes_at_rest(scene: Scene, device: ComputeDevice) -> None:
    """By the share of a plain mean of the frames at rest, as soon as there are enough."""
    with turns(scene, device) as driver:
        client = driver.join()
        driver.answer(client)
        driver.ask(client, view=replace(VIEW, yaw_deg=2.0), frames=14)
        driver.settle()
        shown = driver.shown(client)
    with renderer_of(scene, device) as renderer:
        renderer.render(1)
        renderer.look(replace(VIEW, yaw_deg=2.0))
        for number in range(14):
            renderer.fading = min(SETTINGS.fading, 1.0 / (number + 1))
            picture = renderer.render(1)
    assert shown.frames == 14
    assert np.array_equal(shown.picture.color, picture.color)


def assert_alike(one: RenderedFrame, other: RenderedFrame) -> None:
    """Of one thing; views share E_R, which is known the better the more of them have looked."""
    difference = np.abs(one.color - other.color)
    assert difference.mean() < 5e-3 * other.color.mean()
    assert difference.max() < 0.2 * other.color.mean()


@pytest.mark.thorough
def test_clients_see_what_each_alone_would(scene: Scene, device: ComputeDevice) -> None:
    requests = [
        {"view": VIEW, "frames": 3},
        {"view": replace(VIEW, width=24, yaw_deg=20.0), "frames": 4, "aovs": ("normal",)},
    ]
    alone = []
    for request in requests:
        with turns(scene, device) as driver:
            client = driver.join(**request)
            driver.answer(client)
            driver.settle()
            alone.append(driver.shown(client))
    with turns(scene, device) as driver:
        clients = [driver.join(**request) for request in requests]
        for client in clients:
            driver.answer(client)
        built = len(device.built_programs)
        driver.settle()
        assert len(device.built_programs) == built
        together = [driver.shown(client) for client in clients]
    for one, other in zip(alone, together, strict=True):
        assert_alike(one.picture, other.picture)
        assert one.frames == other.frames
    assert set(together[1].picture.aovs) == {"normal"}


@pytest.mark.thorough
def test_who_moves_comes_before_who_refines(scene: Scene, device: ComputeDevice) -> None:
    with turns(scene, device) as driver:
        patient = driver.join(frames=500)
        driver.answer(patient)
        moving = driver.join()
        driver.answer(moving)
        for number in range(3):
            before = driver.shown(patient).step
            asked = driver.ask(moving, view=replace(VIEW, yaw_deg=float(number)))
            assert driver.core.turn()
            assert driver.shown(moving).number >= asked
            assert driver.shown(patient).step == before
            assert driver.core.turn()
            assert driver.shown(patient).step == before + 1


@pytest.mark.thorough
def test_a_resized_window_needs_no_other_kernels(scene: Scene, device: ComputeDevice) -> None:
    with turns(scene, device) as driver:
        client = driver.join()
        driver.answer(client)
        built = len(device.built_programs)
        for size in ((1, 1), (33, 7), (1, 40)):
            shown = driver.answer(client, driver.ask(client, view=VIEW.resized(*size)))
            assert shown.picture.color.shape == (size[1], size[0], 3)
            assert np.isfinite(shown.picture.color).all()
        assert len(device.built_programs) == built
        assert driver.shared.status.problems == ()


def test_other_buffers_of_a_refined_picture_cost_no_frame(
    scene: Scene, device: ComputeDevice
) -> None:
    with turns(scene, device) as driver:
        client = driver.join(frames=2, geometry=False)
        driver.answer(client)
        driver.settle()
        before = driver.shown(client)
        shown = driver.answer(client, driver.ask(client, frames=2, aovs=("depth",)))
    assert before.geometry is None
    assert shown.geometry is not None
    assert shown.step == before.step
    assert np.array_equal(shown.picture.color, before.picture.color)
    assert shown.picture.aovs["depth"].shape == (16, 32)


def edited(driver: Turns, edit: ObjectEdit) -> int:
    return driver.shared.change(lambda world: world.having(edit))


@pytest.mark.thorough
def test_edits_are_seen_as_a_renderer_of_them_shows(scene: Scene, device: ComputeDevice) -> None:
    to_world = scene.instances[0].to_world.copy()
    to_world[0, 3] += 0.2
    green = Material("plastic", (0.1, 0.6, 0.1), alpha=0.2)
    moved = replace(scene.instances[0], to_world=to_world)
    mesh = replace(moved.mesh, materials=(green,))
    with turns(scene, device) as driver:
        client = driver.join()
        driver.answer(client)
        placed = driver.answer(client, edited(driver, ObjectEdit("cube", flat(to_world))))
        painted = driver.answer(client, edited(driver, ObjectEdit("cube", flat(to_world), green)))
        removed = driver.answer(client, edited(driver, ObjectEdit("cube", removed=True)))
        back = driver.answer(client, driver.change(edits=()))
    with renderer_of(scene, device) as renderer:
        first = renderer.render(1)
        renderer.move([moved])
        renderer.fading = SETTINGS.fading
        assert_alike(placed.picture, renderer.render(1))
    with renderer_of(scene, device, instances=[replace(moved, mesh=mesh)]) as renderer:
        assert_alike(painted.picture, renderer.render(1))
    with renderer_of(scene, device, instances=[]) as renderer:
        assert np.array_equal(removed.picture.color, renderer.render(1).color)
    assert_alike(back.picture, first)


# The video ------------------------------------------------------------------------------------


def test_the_video_plays_by_its_clock(scene: Scene, device: ComputeDevice) -> None:
    """Frames whose time has passed are dropped; the last one stays; looking goes on meanwhile."""
    with turns(scene, device) as driver:
        client = driver.join(frames=2)
        driver.answer(client)
        driver.change(playback=Playback(0, driver.clock.now))
        seen = []
        for due in (1, 2, 7, 8, 11, 40):
            driver.clock.now = 100.0 + (due + 0.5) / 24.0
            wanted = min(due, 11)
            driver.until(lambda wanted=wanted: driver.shown(client).frame == wanted)
            seen.append(driver.shown(client))
            if due == 8:
                asked = driver.ask(client, view=replace(VIEW, yaw_deg=3.0), frames=2)
                assert driver.answer(client, asked).frame == 8
        driver.settle()
        last = driver.shown(client)
    assert [shown.frame for shown in seen] == [1, 2, 7, 8, 11, 11]
    assert last.frame == 11
    assert last.refined


def test_frames_that_are_late_are_not_decoded(
    scene: Scene, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    decoded: list[int] = []
    stream = Scene.stream

    def noting(self: Scene, indices: Iterator[int], **options: bool) -> Ahead[Frame]:
        return stream(self, (decoded.append(i) or i for i in indices), **options)

    monkeypatch.setattr(Scene, "stream", noting)
    with turns(scene, device) as driver:
        client = driver.join()
        driver.answer(client)
        driver.change(playback=Playback(0, driver.clock.now))
        driver.core.turn()
        driver.until(lambda: 3 in decoded)  # as far ahead as there is room
        driver.clock.now += 9.5 / 24.0
        driver.until(lambda: driver.shown(client).frame == 9)
    assert not {5, 6, 7, 8} & set(decoded)


def test_a_video_rests_at_its_end(tmp_path: Path, device: ComputeDevice) -> None:
    """Or its last frame would stay as it is in motion."""
    with turns(Scene.open(write_clip(tmp_path, 4)), device) as driver:
        client = driver.join()
        driver.answer(client)
        for due, since in ((1.5, True), (3.5, False)):
            started = Playback(1, 100.0)
            driver.clock.now = 100.0
            driver.change(playback=started)
            driver.clock.now = 100.0 + due / 24.0
            last = min(1 + int(due), 3)
            driver.until(lambda last=last: driver.shown(client).frame == last)
            driver.settle()
            assert driver.shared.world.playback == (started if since else Playback(3))


def test_the_objects_are_listed_as_they_are_shown(tmp_path: Path, device: ComputeDevice) -> None:
    """They are those of the frame that is shown, as edited."""
    folder = write_clip(tmp_path, 12)
    manifest = folder / "scene.toml"
    keys = "[[objects.keyframes]]\ntime = {}\ntranslation = [{}, 0, 0]\n"
    keyframes = keys.format(0.0, 0.0) + keys.format(0.25, 0.6)
    text = manifest.read_text().replace("\n[[views]]", f"\n{keyframes}\n[[views]]")
    still = text[text.index("[[objects]]") : text.index("[[objects.keyframes]]")]
    manifest.write_text(text + "\n" + still.replace('"cube"', '"still"'))
    scene = Scene.open(folder)
    material = Material("plastic", (0.9, 0.8, 0.7), alpha=0.05)
    with turns(scene, device) as driver:
        assert driver.core.objects == ()
        client = driver.join()
        driver.change(playback=Playback(3))
        driver.answer(client)
        driver.settle()
        moving, still_one = driver.core.objects
        assert (moving.name, still_one.name) == ("cube", "still")
        assert (moving.keyframed, still_one.keyframed) == (True, False)
        base = scene.objects[0].motion.to_world
        np.testing.assert_allclose(moving.to_world[:3, 3] - base[:3, 3], (0.3, 0, 0), atol=1e-12)
        assert np.array_equal(moving.motion.to_world, base)
        low, high = moving.corners
        assert np.array_equal((low, high), [[-1] * 3, [1] * 3])
        wanted = moving.to_world.copy()
        wanted[:3, 3] = 0.2, -0.9, -1.4
        driver.shared.change(
            lambda world: world.edited(
                "cube", to_world=flat(moving.placed(wanted)), material=material
            ).edited("still", removed=True)
        )
        driver.settle()
        (edited,) = driver.core.objects
        np.testing.assert_allclose(edited.to_world, wanted, atol=1e-12)
        assert edited.materials == (material,)
        assert edited.corners is moving.corners
