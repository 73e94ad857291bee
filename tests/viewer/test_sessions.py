"""Renderers of several clients within a limit of memory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.buffers import BufferDevice
from iprt.device.compute import ComputeDevice
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from tests.viewer.test_accumulating_renderer import made as made
from tests.viewer.turns import FEWEST, VIEW, Turns, turns


def compared(driver: Turns) -> tuple[int, int]:
    """Two clients with pictures at rest, as if of a method and another."""
    clients = driver.join(frames=3), driver.join(view=replace(VIEW, yaw_deg=20.0), frames=3)
    for client in clients:
        driver.answer(client)
    driver.settle()
    return clients


@pytest.mark.parametrize("limit", [1 << 40, 1])
def test_pictures_that_do_not_fit_beside_each_other_are_refined_in_turn(
    scene: Scene,
    device: ComputeDevice,
    made: list[Renderer],
    monkeypatch: pytest.MonkeyPatch,
    limit: int,
) -> None:
    if not device.is_cpu:
        pytest.skip("its buffers are not the process's memory")
    monkeypatch.setattr("iprt.viewer.sessions.MOST_BYTES", limit)
    with turns(scene, device, FEWEST) as driver:
        clients = compared(driver)
        shown = [driver.shown(client) for client in clients]
        assert all(one.refined for one in shown)
        kept = sum(len(driver.core._sessions[client]._renderers) for client in clients)
        # The first picture of one, all of the other, and all of the first again.
        assert (kept, len(made)) == ((2, 2) if limit > 1 else (1, 3))
        # The same again needs no renderer, even if it is gone.
        for client, one in zip(clients, shown, strict=True):
            again = driver.answer(client, driver.ask(client, view=one.request.view, frames=3))
            assert np.array_equal(again.picture.color, one.picture.color)
            assert again.refined
        assert len(made) == (2 if limit > 1 else 3)


def test_nothing_stays_of_closed_clients(scene: Scene, device: ComputeDevice) -> None:
    if not device.is_cpu:
        pytest.skip("its buffers are not the process's memory")
    with turns(scene, device, FEWEST) as driver:
        before = device.hosted
        for client in compared(driver):
            driver.shared.leave(client)
        assert device.hosted > before
        driver.core.turn()
        device.wait()
        assert device.hosted <= before


def test_a_window_of_about_the_same_size_takes_the_place_of_the_last(
    scene: Scene, device: ComputeDevice, made: list[Renderer], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A renderer of half the width is kept, as in motion."""
    if not device.is_cpu:
        pytest.skip("its buffers are not the process's memory")
    monkeypatch.setattr("iprt.viewer.sessions.MOST_BYTES", 1)
    with turns(scene, device, FEWEST) as driver:
        client = driver.join()
        for width, kept in ((32, [32]), (28, [28]), (10, [10, 28]), (28, [28, 10])):
            driver.answer(client, driver.ask(client, view=VIEW.resized(width, 16)))
            renderers = driver.core._sessions[client]._renderers
            assert [one._renderer.view.width for one in renderers] == kept
    assert len(made) == 3


def test_histories_given_back_change_no_bit(
    scene: Scene, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The next change restarts the fast histories."""

    def pictures() -> list[np.ndarray]:
        found = []
        with Renderer(device, scene.frame(), scene.instances, VIEW) as renderer:
            for _ in range(2):
                step = np.eye(4)
                step[0, 3] = 0.05
                moved = [replace(one, to_world=step @ one.to_world) for one in renderer.instances]
                renderer.move(moved)
                found += [renderer.render(1).color, renderer.render(10).color]
        return found

    discarded: list[int] = []
    known = BufferDevice.discard

    def discard(self: BufferDevice, *arrays: object) -> None:
        discarded.append(len(arrays))
        known(self, *arrays)  # type: ignore[arg-type]

    monkeypatch.setattr(BufferDevice, "discard", discard)
    given_back = pictures()
    assert max(discarded) > 1
    monkeypatch.setattr(BufferDevice, "discard", lambda *_: None)
    for one, other in zip(given_back, pictures(), strict=True):
        assert np.array_equal(one, other)
