"""Pixels on which objects have no visible influence keep the panorama's radiance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from iprt.device.compute import ComputeDevice
from iprt.filter.influence import VISIBLE, Probes
from iprt.gbuffer.guide import Guides
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from iprt.trace.sparse import SparseMethod
from tests.oracles.worlds import World
from tests.worlds import ball, ceiling_lamp, room_frame

VIEW = View(256, 128, projection="equirect")
FRAME = room_frame(World(), 128, 64, ceiling_lamp)
BALL = ball((0.4, -1.25, -1.2), 0.12, Material("diffuse", (0.5, 0.3, 0.2)))
SETTINGS = Settings(fading=0.1)


def sleeping(renderer: Renderer) -> NDArray[np.bool_]:
    """Pixels of the real layer that sleep."""
    method = renderer.method
    assert isinstance(method, SparseMethod)
    assert method.real_pixels is not None
    guide = method.real_pixels.guide
    planes = guide.layout.interior(renderer.device.read(guide.current))
    return np.asarray(planes[-1] < 0.0)


def ratio(renderer: Renderer) -> NDArray[np.float32]:
    return renderer.render(1, ["ratio"]).aovs["ratio"]


@pytest.fixture
def wide_awake(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Return a function after which no tile sleeps any more."""
    run = Guides.run
    return lambda: monkeypatch.setattr(Guides, "run", lambda self, view, **_: run(self, view))


def test_what_sleeps_is_the_panorama(device: ComputeDevice, wide_awake: Callable[[], None]) -> None:
    with Renderer(device, FRAME, [BALL], VIEW, SETTINGS) as renderer:
        rendered = renderer.render(24, ["irradiance_real"])
        picture, irradiance = rendered.color, rendered.aovs["irradiance_real"]
        # Pixels at edges of surfaces show what is beyond, too.
        asleep = ~maximum_filter(~sleeping(renderer), 5)
    assert 0.3 < asleep.mean() < 0.97
    # Cells around are known by what probes needed.
    assert (irradiance[asleep] > 0.0).all(-1).mean() > 0.8
    with Renderer(device, FRAME, [], VIEW, SETTINGS) as renderer:
        panorama = renderer.render(1).color
    assert (picture[asleep] == panorama[asleep]).all()
    wide_awake()
    with Renderer(device, FRAME, [BALL], VIEW, SETTINGS) as renderer:
        everywhere = renderer.render(24).color
        assert not sleeping(renderer).any()
    change = np.abs(everywhere - panorama).max(-1)
    visible = VISIBLE * np.average(FRAME.color.mean(-1))
    assert change[asleep].mean() < visible
    assert np.quantile(change[asleep], 0.99) < 4.0 * visible


def test_a_shadow_on_sleeping_surfaces_wakes_them(
    device: ComputeDevice, wide_awake: Callable[[], None]
) -> None:
    """An object that appears elsewhere has its shadow after a few frames."""
    far, moved = (replace(BALL, to_world=BALL.to_world.copy()) for _ in range(2))
    far.to_world[:3, 3] = -0.9, -1.25, 1.0
    moved.to_world[:3, 3] = 0.2, -0.6, -1.4  # in the air: its shadow lies apart from it

    def after_the_jump() -> tuple[NDArray[np.bool_], list[NDArray[np.float32]]]:
        with Renderer(device, FRAME, [far], VIEW, SETTINGS) as renderer:
            renderer.render(24)
            asleep = sleeping(renderer)
            renderer.move([moved])
            return asleep, [ratio(renderer) for _ in range(6)]

    asleep, found = after_the_jump()
    wide_awake()
    _, truth = after_the_jump()
    shadow = truth[-1].mean(-1) < 0.95
    assert (shadow & asleep).sum() > 50
    shadow &= asleep
    depth = [(1.0 - one.mean(-1))[shadow].mean() for one in found]
    expected = (1.0 - truth[-1].mean(-1))[shadow].mean()
    assert depth[2] > 0.7 * expected
    assert depth[5] > 0.9 * expected


def test_probes_alone_find_a_shadow_far_from_anything_awake(
    device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The view shows only floor, all of it asleep. An object moves between it and the lamp."""
    floor = View(128, 128, fov_y_deg=50.0, yaw_deg=8.0, pitch_deg=-50.0)
    far = ball((-1.2, -0.85, 2.3), 0.5, Material("diffuse", (0.5, 0.3, 0.2)))
    above = replace(far, to_world=far.to_world.copy())
    above.to_world[:3, 3] = 0.2, 0.3, -1.4

    def after_the_move() -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
        with Renderer(device, FRAME, [far], floor, SETTINGS) as renderer:
            renderer.render(24)
            assert sleeping(renderer).all()
            renderer.move([above])
            found = renderer.render(12, ["ratio"]).aovs["ratio"]
            return sleeping(renderer), found

    with Renderer(device, FRAME, [above], floor, SETTINGS) as renderer:
        expected = (1.0 - renderer.render(24, ["ratio"]).aovs["ratio"]).mean()
    assert expected > 0.1
    asleep, found = after_the_move()
    assert asleep.mean() < 0.05
    assert (1.0 - found).mean() > 0.8 * expected
    monkeypatch.setattr(Probes, "place", lambda *_: None)
    asleep, found = after_the_move()
    assert asleep.all()
    assert (found == 1.0).all()


def test_a_mean_of_all_frames_has_no_sleeping_pixels(device: ComputeDevice) -> None:
    with Renderer(device, FRAME, [BALL], VIEW, Settings(fading=0.0)) as renderer:
        renderer.render(12)
        assert not sleeping(renderer).any()


def test_what_is_known_at_rest_stays_awake_in_motion(device: ComputeDevice) -> None:
    """As in the viewer, which averages all frames until something moves."""
    with Renderer(device, FRAME, [BALL], VIEW, SETTINGS) as renderer:
        renderer.fading = 0.0
        renderer.render(15)
        before = ratio(renderer)
        assert not sleeping(renderer).any()
        renderer.fading = SETTINGS.fading
        renderer.step()
        asleep = sleeping(renderer)
    assert asleep.mean() > 0.3
    assert np.abs(before[asleep] - 1.0).mean() < 0.004
    assert np.abs(before[asleep] - 1.0).max() < 0.1
