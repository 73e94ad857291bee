"""Pictures in motion and at rest: each with a renderer that is kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.renderer import Renderer
from iprt.scene.object_edits import flat
from iprt.scene.scene import Scene
from iprt.viewer.session import KEPT
from tests.viewer.turns import SETTINGS, VIEW, turns


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Renderer]:
    """All renderers that canvases make."""
    found: list[Renderer] = []

    def record(*args: object, **kwargs: object) -> Renderer:
        found.append(Renderer(*args, **kwargs))
        return found[-1]

    monkeypatch.setattr("iprt.viewer.accumulating_renderer.Renderer", record)
    return found


@pytest.mark.thorough
def test_going_back_and_forth_makes_nothing_anew(
    scene: Scene, device: ComputeDevice, made: list[Renderer]
) -> None:
    small = VIEW.resized(16, 8)
    with turns(scene, device) as driver:
        client = driver.join(frames=2)
        for turn in range(3):
            moved = replace(small, yaw_deg=10.0 * turn)
            driver.answer(client, driver.ask(client, view=moved))
            driver.answer(client, driver.ask(client, view=moved.resized(32, 16), frames=2))
        assert len(made) == KEPT == 2
        # The picture at rest is still the one that a renderer alone comes to.
        driver.settle()
        shown = driver.shown(client)
        assert shown.frames == 2
        with Renderer(device, scene.frame(0), scene.instances, VIEW, SETTINGS) as alone:
            for turn in range(3):
                alone.look(replace(VIEW, yaw_deg=10.0 * turn))
                alone.fading = SETTINGS.fading
                picture = alone.render()
            alone.fading = min(SETTINGS.fading, 0.5)
            picture = alone.render()
        # But for E_R, which the small picture has refined too.
        difference = np.abs(shown.picture.color - picture.color)
        assert difference.mean() < 5e-3 * picture.color.mean()


@pytest.mark.thorough
def test_renderers_of_a_third_kind_take_the_oldest_place(
    scene: Scene, device: ComputeDevice, made: list[Renderer], monkeypatch: pytest.MonkeyPatch
) -> None:
    closed: list[Renderer] = []
    monkeypatch.setattr(Renderer, "close", lambda renderer: closed.append(renderer))
    with turns(scene, device) as driver:
        client = driver.join()
        for width in (32, 16, 24):
            driver.answer(client, driver.ask(client, view=VIEW.resized(width, 8)))
        assert closed == made[:-KEPT]
    assert set(closed) == set(made)


@pytest.mark.thorough
def test_surfaces_come_at_rest(scene: Scene, device: ComputeDevice) -> None:
    """Not while the camera turns; real ones stay known while an object moves over them."""
    with turns(scene, device) as driver:
        client = driver.join(frames=3)
        assert driver.answer(client).geometry is None
        driver.settle()
        rested = driver.shown(client).geometry
        assert rested is not None
        cube = np.array(scene.objects[0].motion.to_world)
        cube[0, 3] += 0.1
        moved = driver.shared.world.edited("cube", to_world=flat(cube))
        shown = driver.answer(client, driver.change(edits=moved.edits))
        assert shown.frames == 1
        assert shown.geometry is rested
        driver.settle()
        after = driver.shown(client).geometry
        assert after is not None
        assert (after.coverage != rested.coverage).any()
        np.testing.assert_array_equal(after.real_depth, rested.real_depth)
        turned = driver.answer(
            client, driver.ask(client, view=replace(VIEW, yaw_deg=9.0), frames=3)
        )
        assert turned.geometry is None
