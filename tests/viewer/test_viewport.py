"""A window's camera, lens and picking, on a real engine."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import imageio.v3
import numpy as np
import pytest

from iprt.aovs import AOVS
from iprt.device.compute import ComputeDevice
from iprt.errors import IprtError
from iprt.geometry.camera import View
from iprt.output.display import display
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from iprt.viewer.controls import with_value
from iprt.viewer.displayed_frame import DisplayedFrame
from iprt.viewer.engine import Engine
from iprt.viewer.lens import Lens
from iprt.viewer.viewport import Viewport
from tests.clips import write_clip
from tests.viewer.turns import SETTINGS
from tests.viewer.viewports import LOOK, at_rest, until
from tests.waiting import DEADLINE_S


@pytest.fixture
def engine(device: ComputeDevice, tmp_path: Path) -> Iterator[Engine]:
    scene = Scene.open(write_clip(tmp_path / "clip", 4))
    with Engine(scene, lambda: device, SETTINGS) as made:
        yield made


@pytest.fixture
def viewport(engine: Engine) -> Iterator[Viewport]:
    made = Viewport(engine, LOOK, frames=2)
    yield made
    made.close()


def test_dragging_keeps_the_scene_under_the_cursor(viewport: Viewport) -> None:
    """At the centre, where degrees per pixel are those of the focal length."""
    before = viewport.view
    viewport.turn(0.01, -0.02)
    after = viewport.view
    center = np.array([24.0, 16.0])
    seen = before.project(after.unproject(center)) - center
    np.testing.assert_allclose(seen, np.array([-0.01 * np.cos(np.deg2rad(30)), 0.02]), atol=1e-5)
    viewport.turn(0.0, 1e6)
    assert viewport.view.pitch_deg == 90.0
    viewport.turn(1e5, 0.0)
    assert -180.0 <= viewport.view.yaw_deg < 180.0
    viewport.zoom(1.0)
    assert viewport.view.fov_y_deg < before.fov_y_deg
    viewport.zoom(-1000.0)
    assert viewport.view.fov_y_deg < 180.0


def test_a_panorama_keeps_its_sides(engine: Engine) -> None:
    """Whatever the window's are, and there is nothing to turn or zoom."""
    viewport = Viewport(engine, View(48, 32, projection="equirect"), frames=1)
    for window, size in (((40, 60), (40, 20)), ((60, 10), (20, 10)), ((1, 1), (1, 1))):
        viewport.resize(*window)
        assert (viewport.view.width, viewport.view.height) == size
    asked = viewport._wanted
    viewport.zoom(3.0)
    viewport.turn(5.0, 5.0)
    assert viewport._wanted is asked
    viewport.close()


def test_exposure_renders_nothing_anew(viewport: Viewport, engine: Engine) -> None:
    before = at_rest(viewport)
    viewport.lens = Lens(exposure_ev=1.0)
    after = until(viewport, lambda s: s is not before)
    assert after.shown is before.shown
    expected = display(after.shown.picture.color, 2.0 * engine.scene.exposure)
    np.testing.assert_array_equal(after.pixels, np.rint(255.0 * expected))


@pytest.mark.thorough
def test_comparisons_are_of_the_same_view(
    viewport: Viewport, engine: Engine, device: ComputeDevice
) -> None:
    """The input is the video as it is; ours has shadows beside the object."""
    viewport.lens = Lens(against="input", split=0.0)
    viewport.turn(1.0, 0.0)
    displayed = until(
        viewport,
        lambda s: (
            "|" in s.caption
            and s.shown.request == viewport._wanted
            and s.shown.geometry is not None
        ),
    )
    with Renderer(device, engine.scene.frame(0), (), viewport.view, SETTINGS) as renderer:
        video = Lens().develop(renderer.render().color, engine.scene.exposure)
    geometry = displayed.shown.geometry
    beside = geometry.coverage == 0.0
    ours = Lens().develop(displayed.shown.picture.color, engine.scene.exposure)
    assert (np.abs(ours.astype(int) - video)[beside] > 4).any(), "no shadow"
    np.testing.assert_array_equal(displayed.pixels, video)


@pytest.mark.thorough
def test_a_method_is_compared_by_its_own_picture(
    viewport: Viewport, engine: Engine, device: ComputeDevice
) -> None:
    """With the defaults that come with it; and while it is on its way, no other's is shown."""
    captions = set()
    for method in ("ibl", "em"):
        viewport.lens = Lens(against=method, split=0.0)

        def there(displayed: DisplayedFrame, method: str = method) -> bool:
            captions.add(displayed.caption)
            other = viewport._baseline and viewport._baseline.shown
            return (
                f"| Method {method}" in displayed.caption
                and displayed.shown.refined
                and other is not None
                and other.refined
            )

        until(viewport, there)
        displayed = until(viewport, lambda _: True)
        settings = with_value(engine.world.settings, "method", method)
        settings = settings.model_copy(update={"fading": 0.0})
        instances, view = engine.scene.instances, displayed.shown.request.view
        frames = displayed.shown.frames
        with Renderer(device, engine.scene.frame(0), instances, view, settings) as renderer:
            wanted = renderer.render(frames).color
        np.testing.assert_array_equal(
            displayed.pixels, Lens().develop(wanted, engine.scene.exposure)
        )
    assert any("em is being rendered" in caption for caption in captions)


def test_readout_is_what_files_hold(viewport: Viewport, tmp_path: Path) -> None:
    viewport.lens = Lens(buffer="depth")
    displayed = at_rest(viewport)
    path = viewport.screenshot(".exr", tmp_path)
    import OpenEXR

    with OpenEXR.File(str(path)) as file:
        channels = file.parts[0].channels
        radiance, depth = channels["RGB"].pixels, channels["depth.Z"].pixels
        assert json.loads(file.header()["iprt:view"])["pitch_deg"] == LOOK.pitch_deg
    for x, y in ((0.0, 0.0), (0.5, 0.5), (0.99, 0.99)):
        read = viewport.readout(x, y)
        assert read is not None
        np.testing.assert_array_equal(read.radiance, radiance[read.y, read.x])
        assert read.value is not None
        assert read.value[0] == depth[read.y, read.x]
        assert read.unit == "m"
        assert read.depth_m == pytest.approx(depth[read.y, read.x], rel=1e-3)
    assert viewport.readout(1.0, 0.5) is None
    png = viewport.screenshot(".png", tmp_path)
    np.testing.assert_array_equal(imageio.v3.imread(png), displayed.pixels)
    with pytest.raises(IprtError, match=r"0001\.tga"):
        viewport.screenshot(".tga", tmp_path)


def test_dropped_objects_stand_where_the_cursor_is(viewport: Viewport, engine: Engine) -> None:
    at_rest(viewport)
    x, y = 0.5, 0.95
    surface = viewport._client.shown.geometry.real(24, 30)
    (state,) = engine.objects
    placed = viewport.dropped(state, x, y, upright=True)
    assert placed is not None
    engine.editor.place({"cube": placed})
    number = viewport._client.ask(viewport._request())
    until(viewport, lambda s: s.shown.number >= number and s.shown.refined)
    (state,) = engine.objects
    low, high = state.corners
    foot = state.to_world @ [0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2]), 1.0]
    np.testing.assert_allclose(foot[:3], surface.point, atol=1e-4)
    assert viewport.picking.object_at(x, y - 0.02) == "cube"


def test_all_buffers_can_be_seen(viewport: Viewport) -> None:
    for name in AOVS:
        viewport.lens = Lens(buffer=name)
        displayed = until(viewport, lambda s, name=name: name in s.shown.picture.aovs)
        assert displayed.pixels.shape == (32, 48, 3)


def test_views_of_the_scene_are_known_by_name(viewport: Viewport, engine: Engine) -> None:
    (name,) = engine.scene.views
    assert viewport.name == name
    viewport.turn(1.0, 0.0)
    assert viewport.name is None
    viewport.go_to(name)
    assert viewport.name == name
    assert viewport.view == LOOK
    viewport.look(replace(LOOK, fov_y_deg=50.0))
    assert viewport.name is None


def test_motion_gives_up_what_rest_gives_back(device: ComputeDevice, tmp_path: Path) -> None:
    """An impossible frame rate: little resolution while the camera turns, all of it at rest."""
    scene = Scene.open(write_clip(tmp_path / "clip", 1))
    with Engine(scene, lambda: device, SETTINGS) as engine:
        viewport = Viewport(engine, LOOK, target_fps=1e4, frames=2)
        assert at_rest(viewport).preview is None
        end = time.monotonic() + DEADLINE_S
        displayed = viewport.poll()
        while displayed is None or displayed.pixels.shape[0] == LOOK.height:
            viewport.turn(1.0, 0.0)
            displayed = viewport.poll()
            assert time.monotonic() < end
            time.sleep(0.005)
        assert displayed.preview is not None
        # The same places are the same directions.
        small, large = displayed.shown.request.view, viewport.view
        corner = np.array([0.25, 0.75])
        np.testing.assert_allclose(
            small.unproject(corner * (small.width, small.height)),
            replace(large, yaw_deg=small.yaw_deg).unproject(corner * (large.width, large.height)),
            atol=0.02,
        )
        rested = until(viewport, lambda s: s.pixels.shape == (LOOK.height, LOOK.width, 3))
        assert rested.preview is None
        viewport.close()


def test_nothing_is_told_of_speed_at_rest(engine: Engine) -> None:
    now = [0.0]
    viewport = Viewport(engine, LOOK, frames=2, clock=lambda: now[0])
    at_rest(viewport)
    for _ in range(3):
        now[0] += 0.2
        viewport.turn(1.0, 0.0)
        moving = until(viewport, lambda s: s.shown.request.view == viewport.view)
    assert moving.latency_s is not None
    assert moving.fps == pytest.approx(5.0)
    now[0] += 10.0
    rested = at_rest(viewport)
    assert (rested.latency_s, rested.fps) == (None, None)
    assert viewport.poll() is rested
    viewport.close()


def test_a_slow_window_counts_what_moves(engine: Engine) -> None:
    """It looks when each picture is refined already, and has never seen its first view frame."""
    now = [0.0]
    viewport = Viewport(engine, LOOK, frames=2, clock=lambda: now[0])
    at_rest(viewport)
    for _ in range(3):
        now[0] += 0.2
        viewport.turn(1.0, 0.0)
        end = time.monotonic() + DEADLINE_S
        while True:
            shown = viewport._client.shown
            if shown is not None and shown.refined and shown.request == viewport._wanted:
                break
            assert time.monotonic() < end
            time.sleep(0.005)
        viewport.poll()
    moving = viewport.poll()
    assert moving is not None
    assert moving.fps == pytest.approx(5.0)
    viewport.close()
