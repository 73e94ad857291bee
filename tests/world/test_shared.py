"""Views of one scene share its real world: one panorama, and E_R that is known already."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import RenderedFrame, Renderer
from iprt.settings.model import Settings
from iprt.world.real.real_world import RealWorld
from iprt.world.shared import Worlds
from tests.oracles.worlds import World
from tests.worlds import ball, bright_walls, room_frame

VIEW = View(32, 24, pitch_deg=-35.0)
OBJECTS = [ball((0.0, -1.1, -1.7), 0.3, Material())]


def settings(**others: Any) -> Settings:
    quick = {"gbuffer": "cl", "irradiance": {"rows": 16}, "iprt": {"relight_reflections": False}}
    return Settings.model_validate({**quick, **others})


@pytest.fixture(scope="module")
def frames() -> tuple[Frame, Frame]:
    """One room under two lights, which are one scene to a video."""
    first = room_frame(World(), 64, 32, bright_walls)
    return first, replace(first, index=1, color=(0.9 * first.color).astype(np.float32))


def samples(world: RealWorld) -> np.ndarray:
    """Rays that each cell of E_R is worth."""
    assert world.irradiance is not None
    return np.asarray(world.panorama._device.read(world.irradiance.mean)[:, 3])


def test_a_second_view_finds_irradiance_known(
    device: ComputeDevice, frames: tuple[Frame, Frame]
) -> None:
    worlds = Worlds()
    with Renderer(device, frames[0], OBJECTS, VIEW, settings(), worlds=worlds) as first:
        first.render(4)
        known = samples(first.real_world)
        assert known.sum() > 0
        # Another place, size and number of rays.
        small = View(20, 16, yaw_deg=20.0, pitch_deg=-35.0)
        other = settings(trace={"rays": 3}, atrous={"levels": 2})
        with Renderer(device, frames[0], OBJECTS, small, other, worlds=worlds) as second:
            assert second.real_world is first.real_world
            np.testing.assert_array_equal(samples(second.real_world), known)
            second.step()
            assert (samples(second.real_world) >= known).all()


def test_a_second_view_starts_anew_where_irradiance_is_forgotten(
    device: ComputeDevice, frames: tuple[Frame, Frame]
) -> None:
    worlds = Worlds()
    with Renderer(device, frames[0], OBJECTS, VIEW, settings(), worlds=worlds) as first:
        alone = [first.render(count).color for count in (1, 7)]
        with Renderer(device, frames[0], OBJECTS, VIEW, settings(), worlds=worlds) as other:
            assert not np.array_equal(other.render(1).color, alone[0]), "E_R was known"
        assert first.real_world.irradiance is not None
        first.real_world.irradiance.forget()
        assert not samples(first.real_world).any()
        with Renderer(device, frames[0], OBJECTS, VIEW, settings(), worlds=worlds) as second:
            for count, expected in zip((1, 7), alone, strict=True):
                np.testing.assert_array_equal(second.render(count).color, expected)


@pytest.mark.parametrize(
    "others",
    [
        {"irradiance": {"rows": 32}},
        {"trace": {"thickness": 0.2}},
        {"trace": {"light_sampling": False}},
        {"method": "ibl"},
        {"seed": 5},
    ],
    ids=str,
)
def test_what_rays_find_otherwise_is_not_shared(
    device: ComputeDevice, frames: tuple[Frame, Frame], others: dict[str, Any]
) -> None:
    worlds = Worlds()
    with (
        Renderer(device, frames[0], OBJECTS, VIEW, settings(), worlds=worlds) as one,
        Renderer(device, frames[0], OBJECTS, VIEW, settings(**others), worlds=worlds) as other,
    ):
        assert one.real_world is not other.real_world


def test_what_one_view_loads_all_show(device: ComputeDevice, frames: tuple[Frame, Frame]) -> None:
    worlds = Worlds()
    with (
        Renderer(device, frames[0], OBJECTS, VIEW, settings(), worlds=worlds) as one,
        Renderer(device, frames[0], OBJECTS, VIEW, settings(), worlds=worlds) as other,
    ):
        before = [renderer.render(2, ("background",)) for renderer in (one, other)]
        one.load(frames[1])
        after = [renderer.render(1, ("background",)) for renderer in (one, other)]
        assert one.real_world.version == 2
        for then, now in zip(before, after, strict=True):
            np.testing.assert_allclose(
                now.aovs["background"], 0.9 * then.aovs["background"], rtol=1e-5
            )
        other.load(frames[1])
        assert one.real_world.version == 2


def test_views_follow_the_objects_each_at_its_pace(
    device: ComputeDevice, frames: tuple[Frame, Frame]
) -> None:
    """One hierarchy, and motion since the view's own last frame."""
    worlds = Worlds()
    moved = [replace(OBJECTS[0], to_world=shifted(OBJECTS[0].to_world, 0.1))]
    further = [replace(OBJECTS[0], to_world=shifted(OBJECTS[0].to_world, 0.3))]

    def play(renderer: Renderer, path: list[list[Instance]]) -> list[RenderedFrame]:
        pictures = []
        for instances in path:
            renderer.move(instances)
            pictures.append(renderer.render(1, ("depth", "motion", "coverage")))
        return pictures

    with Renderer(device, frames[0], OBJECTS, VIEW, settings()) as alone:
        expected = play(alone, [OBJECTS, further])[-1]
    with (
        Renderer(device, frames[0], OBJECTS, VIEW, settings(), worlds=worlds) as quick,
        Renderer(device, frames[0], OBJECTS, VIEW, settings(), worlds=worlds) as slow,
    ):
        assert quick.world.objects.bvh is slow.world.objects.bvh
        play(slow, [OBJECTS])
        play(quick, [OBJECTS, moved, further])
        found = play(slow, [further])[-1]
        rested = play(slow, [further])[-1]
    for name, picture in expected.aovs.items():
        np.testing.assert_array_equal(found.aovs[name], picture, name)
    solid = expected.aovs["coverage"] == 1.0
    own = np.indices((VIEW.height, VIEW.width))[::-1].transpose(1, 2, 0) + 0.5
    assert np.abs(found.aovs["motion"] - own)[solid].max() > 1.0
    np.testing.assert_allclose(rested.aovs["motion"][solid], own[solid], atol=1e-3)


def shifted(to_world: np.ndarray, dx: float) -> np.ndarray:
    there = to_world.copy()
    there[0, 3] += dx
    return there


def test_a_world_that_no_view_uses_is_released(
    device: ComputeDevice, frames: tuple[Frame, Frame]
) -> None:
    worlds = Worlds()
    renderer = Renderer(device, frames[0], OBJECTS, VIEW, settings(), worlds=worlds)
    world = weakref.ref(renderer.real_world)
    renderer.close()
    del renderer
    gc.collect()
    assert world() is None


def test_an_abandoned_update_is_made_up_by_the_next_view(
    device: ComputeDevice, frames: tuple[Frame, Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It starts again, because an accumulation over halves of two frames has no value."""

    class AbandonedError(Exception):
        pass

    def abandon(*_: object, **__: object) -> None:
        raise AbandonedError

    worlds = Worlds()
    with (
        Renderer(device, frames[0], OBJECTS, VIEW, settings(), worlds=worlds) as one,
        Renderer(device, frames[0], OBJECTS, VIEW, settings(), worlds=worlds) as other,
    ):
        then = one.render(4, ("background",))
        assert one.real_world.lights is not None
        with monkeypatch.context() as patch:
            patch.setattr(one.real_world.lights, "load", abandon)
            with pytest.raises(AbandonedError):
                one.load(frames[1])
        other.load(frames[1])
        assert samples(other.real_world).max() <= 1.0
        now = other.render(1, ("background",))
        np.testing.assert_allclose(now.aovs["background"], 0.9 * then.aovs["background"], rtol=1e-5)
        assert other.real_world.cut_version == other.real_world.version
