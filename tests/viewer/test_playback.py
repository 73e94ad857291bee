"""Playback of every frame, loops, and what counters tell, by a clock that the test sets."""

from __future__ import annotations

import pytest

from iprt.device.compute import ComputeDevice
from iprt.scene.scene import Scene
from iprt.viewer.engine import Engine
from iprt.viewer.frame_rate import EventRate, FrameRate
from iprt.viewer.state import Playback
from tests.viewer.turns import SETTINGS, Clock, turns

CLIP_FRAMES = 6


@pytest.mark.thorough
def test_every_frame_is_shown_however_slow_the_device_is(
    scene: Scene, device: ComputeDevice
) -> None:
    """By everybody, before the next; and on a quick device no faster than in the video."""
    with turns(scene, device) as driver:
        clients = [driver.join(frames=4), driver.join(frames=1)]
        for client in clients:
            driver.answer(client)
        driver.change(playback=Playback(0, driver.clock.now, "every frame"))
        seen: list[list[int]] = [[0], [0]]

        def look() -> bool:
            driver.clock.now += 3.0  # the device is slow
            for frames, client in zip(seen, clients, strict=True):
                shown = driver.shown(client).frame
                if shown != frames[-1]:
                    # Nobody is a frame ahead of who has not seen the one before.
                    frames.append(shown)
                    assert len({len(other) for other in seen} - {len(frames)}) <= 1
            return not driver.shared.world.playback.playing

        driver.until(look)
        assert seen == [[0, 1, 2, 3, 4, 5]] * 2
        assert driver.shared.world.playback == Playback(5, None, "every frame")


def test_every_frame_comes_no_faster_than_in_the_video(scene: Scene, device: ComputeDevice) -> None:
    with turns(scene, device) as driver:
        client = driver.join()
        driver.answer(client)
        driver.change(playback=Playback(0, driver.clock.now, "every frame"))
        for frame in range(1, 5):
            driver.settle()
            assert driver.shown(client).frame == frame - 1
            driver.clock.now += 0.9 / 24.0
            driver.settle()
            assert driver.shown(client).frame == frame - 1
            driver.clock.now += 0.2 / 24.0
            driver.until(lambda frame=frame: driver.shown(client).frame == frame)


def test_loop_and_mode_can_be_changed_while_it_plays(scene: Scene, device: ComputeDevice) -> None:
    clock = Clock()
    with Engine(scene, lambda: device, SETTINGS, clock=clock) as engine:
        assert (engine.playback.loop, engine.playback.mode, engine.playback.playing) == (
            False,
            "real time",
            False,
        )
        engine.play()
        clock.now += 2.5 / 24.0
        engine.set_loop(True)
        assert engine.playback == Playback(2, clock.now, "real time", loop=True)
        clock.now += 4.5 / 24.0
        engine.pause()
        assert engine.playback == Playback(0, None, "real time", loop=True)
        engine.set_playback_mode("every frame")
        assert not engine.playback.playing
        engine.seek(5)
        engine.play()
        assert engine.playback == Playback(5, clock.now, "every frame", loop=True)


def test_scenes_say_whether_videos_loop(scene: Scene, device: ComputeDevice) -> None:
    manifest = scene.root / "scene.toml"
    manifest.write_text(manifest.read_text().replace("fps = 24.0", "fps = 24.0\nloop = true"))
    with Engine(Scene.open(scene.root), lambda: device, SETTINGS) as engine:
        assert engine.playback.loop


def test_rates() -> None:
    clock = Clock()
    rate = EventRate(clock)
    assert rate.value is None
    for _ in range(40):
        rate.add()
        clock.now += 0.25
    assert rate.value == pytest.approx(4.0)
    frames = FrameRate(clock)
    for number in range(10):
        for _ in range(3):  # three pictures of each frame of the video
            frames.follow(1.0, number)
            clock.now += 0.5
    assert frames.value == pytest.approx(1 / 1.5)
    frames.follow(2.0, 0)
    assert frames.value is None, "it was started anew"
    frames.follow(None, 0)
    assert frames.value is None
