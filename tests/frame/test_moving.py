"""Objects that move: the frame follows them, and forgets where they were."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.aovs import AOVS
from iprt.device.compute import ComputeDevice
from iprt.device.plan import PlanDevice
from iprt.errors import SceneError
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.memory import RenderPlan
from iprt.renderer import RenderedFrame, Renderer
from tests.frame.whole_frame import (
    CLAY,
    METHOD,
    METHODS,
    VIEW,
    blocks,
    chosen,
    require_only_noise,
    still_life,
    two_frames,
)
from tests.rendering import render
from tests.worlds import Float, ball

pytestmark = pytest.mark.gl

WIDE = View(160, 80, projection="equirect")
VIEWS = pytest.mark.parametrize("view", [VIEW, WIDE], ids=lambda view: view.projection)


@pytest.fixture(scope="module")
def frame() -> Frame:
    return two_frames()[0]


def turn_and_shift(degrees: float, shift: Sequence[float], about: Float) -> Float:
    """(4, 4) of a turn about the vertical through a point, and then a shift."""
    matrix = np.eye(4)
    matrix[:3, :3] = View(1, 1, degrees).world_from_view
    matrix[:3, 3] = about - matrix[:3, :3] @ about + shift
    return matrix


def elsewhere(objects: Sequence[Instance]) -> list[Instance]:
    """The first two of them moved and turned."""
    ways = [turn_and_shift(30.0, (-0.2, 0.05, 0.25), o.to_world[:3, 3]) for o in objects[:2]]
    moved = [replace(o, to_world=way @ o.to_world) for o, way in zip(objects, ways, strict=False)]
    return [*moved, *objects[2:]]


@pytest.mark.thorough
@METHOD
def test_moved_is_as_if_always_there(
    device: ComputeDevice, frame: Frame, method: tuple[str, str]
) -> None:
    """After the histories have forgotten: surfaces bit for bit, light within its noise."""
    there = elsewhere(still_life())
    with Renderer(device, frame, still_life(), VIEW, chosen(method)) as renderer:
        before = renderer.render(3, AOVS)
        renderer.move(there)
        moved = renderer.render(16, AOVS)
    still, again = (render(device, frame, there, VIEW, chosen(method, seed=s), 16) for s in (0, 1))
    for name in ("coverage", "normal", "depth", "albedo"):
        np.testing.assert_array_equal(moved.aovs[name], still.aovs[name])
    assert (before.aovs["coverage"] != still.aovs["coverage"]).mean() > 0.05
    require_only_noise(moved.color, still.color, again.color)
    require_only_noise(moved.aovs["ratio"], still.aovs["ratio"], again.aovs["ratio"])


@pytest.mark.thorough
@METHOD
@VIEWS
def test_still_objects_change_no_bit(
    device: ComputeDevice, frame: Frame, view: View, method: tuple[str, str]
) -> None:
    """However often they are told to be where they are."""

    def film(*, told: bool) -> list[RenderedFrame]:
        pictures = []
        with Renderer(device, frame, still_life(), view, chosen(method)) as renderer:
            for _ in range(3):
                if told:
                    renderer.move([replace(o, to_world=o.to_world.copy()) for o in still_life()])
                pictures.append(renderer.render(1, AOVS))
        return pictures

    for one, other in zip(film(told=True), film(told=False), strict=True):
        np.testing.assert_array_equal(one.color, other.color)
        for name in AOVS:
            np.testing.assert_array_equal(one.aovs[name], other.aovs[name])


@pytest.mark.parametrize("gbuffer", ["gl", "cl"])
@VIEWS
def test_motion_is_where_surfaces_were(
    device: ComputeDevice, frame: Frame, view: View, gbuffer: str
) -> None:
    """While they move, also as the head turns; and nowhere else once they stand."""
    objects = still_life()
    path = [objects, elsewhere(objects), elsewhere(elsewhere(objects))]
    settings = chosen(METHODS[0], gbuffer=gbuffer)
    own = np.indices((view.height, view.width))[::-1].transpose(1, 2, 0) + 0.5
    turned = replace(view, yaw_deg=2.0) if view.projection == "perspective" else view
    with Renderer(device, frame, objects, view, settings) as renderer:
        for step, looked in ((0, view), (1, turned), (2, view), (2, view), (2, view)):
            before, previous = renderer.instances, renderer.view
            still = np.array_equal(before[0].to_world, path[step][0].to_world)
            renderer.move(path[step])
            renderer.look(looked)
            picture = renderer.render(1, ("coverage", "depth"))
            visible = renderer.visible  # type: ignore[union-attr]
            motion = renderer.layout.interior(device.read(visible.motion)).transpose(1, 2, 0)
            number = renderer.layout.interior(device.read(visible.id))[0].astype(int)
            seen = picture.aovs["coverage"] == 1.0
            assert seen.sum() > 40
            points = looked.directions() * picture.aovs["depth"][..., None]
            then = points.copy()
            for index, (old, new) in enumerate(zip(before, path[step], strict=True), start=1):
                back = old.to_world @ np.linalg.inv(new.to_world)
                then[number == index] = points[number == index] @ back[:3, :3].T + back[:3, 3]
            error = (motion - previous.project(then))[seen]
            if view.projection == "equirect":
                error[:, 0] -= view.width * np.round(error[:, 0] / view.width)
            assert np.abs(error).max() < 0.01
            if still and previous == looked:
                assert np.abs((motion - own)[seen]).max() < 0.01
            elif not still:
                assert np.median(np.abs((motion - own)[seen & (number <= 2)])) > 0.5


@pytest.mark.thorough
@METHOD
def test_nothing_trails(device: ComputeDevice, method: tuple[str, str]) -> None:
    """A ball rolls below a lamp: eight frames later nothing is left of it and its shadow."""
    frame = two_frames()[1]
    view = View(96, 48, pitch_deg=-45.0, fov_y_deg=60.0)
    places = [(x, -1.25, -1.3) for x in np.linspace(-0.9, 0.9, 19)]
    objects = [[ball(place, 0.2, CLAY)] for place in places]
    with Renderer(device, frame, objects[0], view, chosen(method)) as renderer:
        passing = renderer.render(8, AOVS)
        covers = [passing.aovs["coverage"] > 0.0]
        for moved in objects[1:]:
            renderer.move(moved)
            passing = renderer.render(1, AOVS)
            covers.append(passing.aovs["coverage"] > 0.0)
    there = render(device, frame, objects[-1], view, chosen(method, seed=1, fading=0.0), 32)
    # Its shadow is up to three frames long.
    long_ago = np.any(covers[:-11], axis=0) & ~np.any(covers[-11:], axis=0)
    assert long_ago.sum() > 100
    error = (passing.aovs["ratio"] - there.aovs["ratio"])[long_ago]
    assert np.abs(error).mean() < 0.01
    assert np.percentile(np.abs(error), 99) < 0.03
    # Where it has just been there is a shadow still, so the test could fail.
    assert there.aovs["ratio"].min() < 0.8
    solid = passing.aovs["coverage"] == 1.0
    np.testing.assert_allclose(passing.color[solid].mean(0), there.color[solid].mean(0), rtol=0.1)
    assert np.isfinite(blocks(passing.color)).all()


@pytest.mark.thorough
@METHOD
@VIEWS
def test_moving_takes_no_more_memory_and_boxes_follow(
    own_accounts: ComputeDevice, frame: Frame, view: View, method: tuple[str, str]
) -> None:
    objects = still_life()
    plan = RenderPlan.of(frame, objects, view, chosen(method))
    with Renderer(own_accounts, frame, objects, view, chosen(method)) as renderer:
        renderer.render(1)
        renderer.move(elsewhere(objects))
        renderer.render(2)
        fresh = Renderer(PlanDevice(), frame, elsewhere(objects), view, chosen(method))
        assert fresh._objects is not None
        np.testing.assert_array_equal(
            own_accounts.read(renderer.world.bounds), fresh._objects.bounds
        )
    assert plan.buffers == own_accounts.buffers


def other(instance: Instance, **changes: Any) -> Instance:
    return replace(instance, mesh=replace(instance.mesh, **changes))


def test_only_the_same_objects_move(frame: Frame) -> None:
    first, *rest = objects = still_life()
    mesh = first.mesh
    nowhere = first.to_world.copy()
    nowhere[0, 3] = np.nan
    wrong: list[tuple[list[Instance], str]] = [
        (objects[1:], "cannot move box, ball, ball: the objects are, in this order, ball, box, "),
        ([replace(first, name="cube"), *rest], "cannot move cube, box, "),
        ([*rest, first], "in this order"),
        ([replace(first, to_world=nowhere), *rest], "object ball: to_world must be 4x4 finite"),
        ([replace(first, to_world=np.eye(3)), *rest], "object ball: to_world must be 4x4"),
        ([other(first, triangles=mesh.triangles[::-1]), *rest], "its triangles, vertices or mat"),
        ([other(first, positions=2 * mesh.positions), *rest], "its triangles, vertices or mat"),
        ([other(first, materials=(Material(),)), *rest], "its triangles, vertices or materials"),
    ]
    renderer = Renderer(PlanDevice(), frame, objects, VIEW, chosen(METHODS[0]))
    for moved, message in wrong:
        with pytest.raises(SceneError) as caught:
            renderer.move(moved)
        assert message in str(caught.value)
        assert "\n" not in str(caught.value)
        assert renderer.instances == tuple(objects)
