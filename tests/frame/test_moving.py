"""Objects that move and bend: surfaces are where they are, motion is theirs, nothing stays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
from iprt.geometry.mesh import Instance, Mesh
from iprt.memory import RenderPlan
from iprt.renderer import Renderer
from tests.frame.whole_frame import (
    METHOD,
    METHODS,
    VIEW,
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
CHECKS = np.random.default_rng(0).random((8, 8, 3)).astype(np.float32)
State = tuple[list[Instance], list[Float]]
"""Objects, and (4, 4) from each mesh at rest to the world."""


@pytest.fixture(scope="module")
def frame() -> Frame:
    return two_frames()[0]


def elsewhere(objects: Sequence[Instance]) -> list[Instance]:
    """Return the objects with the first two moved, and turned about the vertical."""
    way, moved = np.eye(4), []
    way[:3, :3] = View(1, 1, 30.0).world_from_view
    for instance in objects[:2]:
        about = instance.to_world[:3, 3]
        way[:3, 3] = about - way[:3, :3] @ about + (-0.2, 0.05, 0.25)
        moved.append(replace(instance, to_world=way @ instance.to_world))
    return [*moved, *objects[2:]]


def moving() -> list[State]:
    first = still_life()
    path = [first, elsewhere(first), elsewhere(elsewhere(first))]
    return [(objects, [one.to_world for one in objects]) for objects in path]


def bent(mesh: Mesh, matrix: Float) -> Mesh:
    """Return the mesh with vertices moved by an affine map (4, 4)."""
    positions = mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
    normals = mesh.normals @ np.linalg.inv(matrix[:3, :3])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return replace(
        mesh,
        positions=positions.astype(np.float32),
        normals=normals.astype(np.float32),
        deforms=True,
    )


def deforming() -> list[State]:
    """Two textured balls that share a mesh, at rest, sheared, then otherwise; one moves besides."""
    first, second = np.eye(4), np.eye(4)
    first[:3] = [[1.1, 0.3, 0.0, 0.1], [0.0, 1.2, 0.0, 0.0], [0.0, -0.2, 0.9, 0.2]]
    second[:3] = [[0.8, 0.0, 0.2, -0.1], [0.2, 0.9, 0.0, 0.1], [0.0, 0.0, 1.2, 0.0]]
    _, *others = still_life()
    mesh = ball((0, 0, 0), 1.0, Material(texture=CHECKS), subdivisions=3).mesh
    mesh = replace(mesh, uvs=np.asarray(mesh.positions[:, :2], np.float32))
    states = []
    for step, bend in enumerate((np.eye(4), first, second)):
        both = bent(mesh, bend)
        near, far = np.diag([0.3, 0.3, 0.3, 1.0]), np.diag([0.2, 0.3, 0.2, 1.0])
        near[:3, 3], far[:3, 3] = (0.0, -1.1, -1.7), (0.7 - 0.1 * step, -1.2, -1.5)
        far[0, 1] = 0.05 * step
        objects = [Instance("near", both, near), Instance("far", both, far), *others]
        states.append((objects, [near @ bend, far @ bend, *(one.to_world for one in others)]))
    return states


PATHS = pytest.mark.parametrize("path", [moving, deforming], ids=lambda path: path.__name__)
Path = Callable[[], list[State]]


@pytest.mark.thorough
@METHOD
@PATHS
def test_followed_is_as_if_always_there(
    device: ComputeDevice, frame: Frame, method: tuple[str, str], path: Path
) -> None:
    """After the histories have forgotten: surfaces are the same, light is within its noise."""
    states = [objects for objects, _ in path()]
    with Renderer(device, frame, states[0], VIEW, chosen(method)) as renderer:
        before = renderer.render(2, AOVS)
        for objects in states[1:]:
            renderer.move(objects)
            renderer.render(1)
        followed = renderer.render(16, AOVS)
    still, again = (
        render(device, frame, states[-1], VIEW, chosen(method, seed=s), 16) for s in (0, 1)
    )
    assert (before.aovs["coverage"] != still.aovs["coverage"]).mean() > 0.02
    np.testing.assert_array_equal(followed.aovs["coverage"], still.aovs["coverage"])
    # Where two triangles meet, either may be seen: trees of bent meshes have another order.
    for name in ("normal", "depth", "albedo"):
        difference = np.abs(followed.aovs[name] - still.aovs[name])
        assert np.percentile(difference, 99.5) < 1e-4
    require_only_noise(followed.color, still.color, again.color)
    require_only_noise(followed.aovs["ratio"], still.aovs["ratio"], again.aovs["ratio"])


@PATHS
@pytest.mark.parametrize("gbuffer", ["gl", "cl"])
@VIEWS
def test_motion_is_where_surfaces_were(
    device: ComputeDevice, frame: Frame, view: View, gbuffer: str, path: Path
) -> None:
    """While they move, also as the head turns; and nowhere else once they stand."""
    states = path()
    settings = chosen(METHODS[0], gbuffer=gbuffer)
    own = np.indices((view.height, view.width))[::-1].transpose(1, 2, 0) + 0.5
    turned = replace(view, yaw_deg=2.0) if view.projection == "perspective" else view
    with Renderer(device, frame, states[0][0], view, settings) as renderer:
        last = 0
        for step, looked in ((0, view), (1, turned), (2, view), (2, view), (2, view)):
            previous = renderer.view
            renderer.move(states[step][0])
            renderer.look(looked)
            picture = renderer.render(1, ("coverage", "depth"))
            visible = renderer.visible  # type: ignore[union-attr]
            motion = renderer.layout.interior(device.read(visible.motion)).transpose(1, 2, 0)
            number = renderer.layout.interior(device.read(visible.id))[0].astype(int)
            points = looked.directions() * picture.aovs["depth"][..., None]
            then = points.copy()
            pairs = zip(states[last][1], states[step][1], strict=True)
            for index, (old, new) in enumerate(pairs, start=1):
                back = old @ np.linalg.inv(new)
                then[number == index] = points[number == index] @ back[:3, :3].T + back[:3, 3]
            error = motion - previous.project(then)
            if view.projection == "equirect":
                error[..., 0] -= view.width * np.round(error[..., 0] / view.width)
            whole = picture.aovs["coverage"] == 1.0
            for index in (1, 2):
                assert (whole & (number == index)).sum() > 3
            assert np.abs(error[whole]).max() < 0.01
            # Borrowed surfaces move with their lenders, which are a pixel away.
            assert np.abs(error[picture.aovs["coverage"] > 0.5]).max() < 2.0
            if last == step and previous == looked:
                assert np.abs((motion - own)[whole]).max() < 0.01
            elif last != step:
                assert np.abs((motion - own)[whole & (number <= 2)]).max() > 1.0
            last = step


@pytest.mark.parametrize(
    ("gbuffer", "path"), [("gl", deforming), ("cl", deforming), ("cl", moving)]
)
def test_only_what_deforms_needs_memory_for_it(
    own_accounts: ComputeDevice, frame: Frame, path: Path, gbuffer: str
) -> None:
    """Boxes follow the objects in the buffers that were planned."""
    first, second = (objects for objects, _ in path()[:2])
    stiff = [replace(one, mesh=replace(one.mesh, deforms=False)) for one in first]
    settings = chosen(METHODS[0], gbuffer=gbuffer)
    plan, without = (RenderPlan.of(frame, those, VIEW, settings) for those in (first, stiff))
    bends = path is deforming
    more = {"bvh displacements", "traced displacement"} if bends and gbuffer == "cl" else set()
    assert set(plan.buffers) - set(without.buffers) == more
    assert plan.features.describe()["motion of every vertex"] == bends
    with Renderer(own_accounts, frame, first, VIEW, settings) as renderer:
        renderer.render(1)
        renderer.move(second)
        renderer.render(1)
        fresh = Renderer(PlanDevice(), frame, second, VIEW, settings)
        assert fresh._objects is not None
        np.testing.assert_array_equal(
            own_accounts.read(renderer.world.objects.device_bounds), fresh._objects.bounds
        )
        if bends:
            with pytest.raises(SceneError, match="object near: cannot move, its triangles, vert"):
                renderer.move(stiff)
    assert own_accounts.buffers == plan.buffers


def test_what_stays_changes_no_bit(device: ComputeDevice, frame: Frame) -> None:
    """Objects that could bend, told again and again to be as they are, and ones that could not."""
    state = deforming()[1][0]
    again = [
        replace(
            one,
            mesh=replace(one.mesh, positions=one.mesh.positions.copy()),
            to_world=one.to_world.copy(),
        )
        for one in state
    ]
    stiff = [replace(one, mesh=replace(one.mesh, deforms=False)) for one in state]
    films = []
    for objects, told in ((state, None), (state, again), (state, state), (stiff, stiff)):
        with Renderer(device, frame, objects, VIEW, chosen(METHODS[0], gbuffer="gl")) as renderer:
            pictures = []
            for _ in range(3):
                if told is not None:
                    renderer.move(told)
                pictures.append(renderer.render(1).color)
        films.append(pictures)
    for other in films[1:]:
        np.testing.assert_array_equal(films[0], other)


def test_only_the_same_objects_move(frame: Frame) -> None:
    first, *rest = objects = still_life()
    mesh = first.mesh
    nowhere = first.to_world.copy()
    nowhere[0, 3] = np.nan

    def other(**changes: Any) -> list[Instance]:
        return [replace(first, mesh=replace(mesh, **changes)), *rest]

    wrong: list[tuple[list[Instance], str]] = [
        (objects[1:], "cannot move box, ball, ball: the objects are, in this order, ball, box, "),
        ([replace(first, name="cube"), *rest], "cannot move cube, box, "),
        ([*rest, first], "in this order"),
        ([replace(first, to_world=nowhere), *rest], "object ball: to_world must be 4x4 finite"),
        ([replace(first, to_world=np.eye(3)), *rest], "object ball: to_world must be 4x4"),
        (other(triangles=mesh.triangles[::-1]), "its triangles, vertices or mat"),
        (other(positions=2 * mesh.positions), "its triangles, vertices or mat"),
        (other(materials=(Material(),)), "its triangles, vertices or materials"),
    ]
    renderer = Renderer(PlanDevice(), frame, objects, VIEW, chosen(METHODS[0]))
    for moved, message in wrong:
        with pytest.raises(SceneError) as caught:
            renderer.move(moved)
        assert message in str(caught.value)
        assert "\n" not in str(caught.value)
        assert renderer.instances == tuple(objects)
