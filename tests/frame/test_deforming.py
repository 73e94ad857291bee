"""Objects whose vertices move: surfaces are where they are, motion is theirs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from iprt.aovs import AOVS
from iprt.device.compute import ComputeDevice
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


@pytest.fixture(scope="module")
def frame() -> Frame:
    return two_frames()[0]


def bent(mesh: Mesh, matrix: Float) -> Mesh:
    """The mesh with vertices moved by an affine map (4, 4)."""
    positions = mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
    normals = mesh.normals @ np.linalg.inv(matrix[:3, :3])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return replace(
        mesh,
        positions=positions.astype(np.float32),
        normals=normals.astype(np.float32),
        deforms=True,
    )


def bends() -> list[Float]:
    """At rest, then sheared and grown, then otherwise."""
    first, second = np.eye(4), np.eye(4)
    first[:3] = [[1.1, 0.3, 0.0, 0.1], [0.0, 1.2, 0.0, 0.0], [0.0, -0.2, 0.9, 0.2]]
    second[:3] = [[0.8, 0.0, 0.2, -0.1], [0.2, 0.9, 0.0, 0.1], [0.0, 0.0, 1.2, 0.0]]
    return [np.eye(4), first, second]


def states(*, textured: bool = False) -> list[list[Instance]]:
    """Two balls that share a mesh, one of them moving; others."""
    _, box, *others = still_life()
    mesh = ball((0, 0, 0), 1.0, Material(texture=CHECKS if textured else None), subdivisions=3).mesh
    mesh = replace(mesh, uvs=np.asarray(mesh.positions[:, :2], np.float32))
    found = []
    for step, bend in enumerate(bends()):
        both = bent(mesh, bend)
        near, far = np.diag([0.3, 0.3, 0.3, 1.0]), np.diag([0.2, 0.3, 0.2, 1.0])
        near[:3, 3], far[:3, 3] = (0.0, -1.1, -1.7), (0.7 - 0.1 * step, -1.2, -1.5)
        far[0, 1] = 0.05 * step
        found.append([Instance("near", both, near), Instance("far", both, far), box, *others])
    return found


def total(instances: Sequence[Instance], step: int) -> list[Float]:
    """(4, 4) from each mesh at rest to the world."""
    bend = bends()[step]
    return [i.to_world @ bend if n < 2 else i.to_world for n, i in enumerate(instances)]


@pytest.mark.thorough
@pytest.mark.parametrize("gbuffer", ["gl", "cl"])
@VIEWS
def test_motion_is_that_of_vertices(
    device: ComputeDevice, frame: Frame, view: View, gbuffer: str
) -> None:
    """Vertices that an affine map moves take every point of the surface with them."""
    path = states()
    turned = replace(view, yaw_deg=2.0) if view.projection == "perspective" else view
    own = np.indices((view.height, view.width))[::-1].transpose(1, 2, 0) + 0.5
    settings = chosen(METHODS[0], gbuffer=gbuffer)
    with Renderer(device, frame, path[0], view, settings) as renderer:
        assert renderer.features.deforming
        last = 0
        for step, looked in ((0, view), (1, turned), (2, view), (2, view), (2, view)):
            previous = renderer.view
            renderer.move(path[step])
            renderer.look(looked)
            picture = renderer.render(1, ("coverage", "depth"))
            visible = renderer.visible  # type: ignore[union-attr]
            motion = renderer.layout.interior(device.read(visible.motion)).transpose(1, 2, 0)
            number = renderer.layout.interior(device.read(visible.id))[0].astype(int)
            seen = picture.aovs["coverage"] > 0.5  # the depth is the object's
            points = looked.directions() * picture.aovs["depth"][..., None]
            then = points.copy()
            pairs = zip(total(path[last], last), total(path[step], step), strict=True)
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
            # Borrowed surfaces bend as those that lend them, which are a pixel away.
            assert np.abs(error[seen]).max() < 2.0
            if last == step:
                assert np.abs((motion - own)[whole]).max() < 0.01
            else:
                assert np.abs((motion - own)[whole & (number <= 2)]).max() > 1.0
            last = step


@pytest.mark.thorough
@METHOD
def test_bent_is_as_if_always_so(
    device: ComputeDevice, frame: Frame, method: tuple[str, str]
) -> None:
    """After the histories have forgotten."""
    path = states(textured=True)
    with Renderer(device, frame, path[0], VIEW, chosen(method)) as renderer:
        before = renderer.render(2, AOVS)
        for state in path[1:]:
            renderer.move(state)
            renderer.render(1)
        followed = renderer.render(16, AOVS)
    still, again = (
        render(device, frame, path[2], VIEW, chosen(method, seed=s), 16) for s in (0, 1)
    )
    assert (before.aovs["coverage"] != still.aovs["coverage"]).mean() > 0.02
    np.testing.assert_array_equal(followed.aovs["coverage"], still.aovs["coverage"])
    # Where two triangles meet, either may be seen: they are in another order.
    for name in ("normal", "depth", "albedo"):
        difference = np.abs(followed.aovs[name] - still.aovs[name])
        assert np.percentile(difference, 99.5) < 1e-4
    require_only_noise(followed.color, still.color, again.color)
    require_only_noise(followed.aovs["ratio"], still.aovs["ratio"], again.aovs["ratio"])


@pytest.mark.parametrize("gbuffer", ["gl", "cl"])
def test_only_what_deforms_needs_memory_for_it(
    own_accounts: ComputeDevice, frame: Frame, gbuffer: str
) -> None:
    path = states()
    stiff = [replace(i, mesh=replace(i.mesh, deforms=False)) for i in path[0]]
    settings = chosen(METHODS[0], gbuffer=gbuffer)
    plan, without = (RenderPlan.of(frame, those, VIEW, settings) for those in (path[0], stiff))
    more = {"bvh displacements", "traced displacement"} if gbuffer == "cl" else set()
    assert set(plan.buffers) - set(without.buffers) == more
    assert plan.features.describe()["motion of every vertex"]
    assert not without.features.describe()["motion of every vertex"]
    with Renderer(own_accounts, frame, path[0], VIEW, settings) as renderer:
        renderer.render(1)
        renderer.move(path[1])
        renderer.render(1)
        with pytest.raises(SceneError, match="object near: cannot move, its triangles, vertices"):
            renderer.move(stiff)
    assert own_accounts.buffers == plan.buffers


def test_what_does_not_bend_changes_no_bit(device: ComputeDevice, frame: Frame) -> None:
    """A mesh that could, told again and again to be as it is, and one that could not."""
    state = states()[1]
    again = [replace(i, mesh=replace(i.mesh, positions=i.mesh.positions.copy())) for i in state]
    stiff = [replace(i, mesh=replace(i.mesh, deforms=False)) for i in state]
    films = []
    for objects, told in ((state, again), (state, state), (stiff, stiff)):
        with Renderer(device, frame, objects, VIEW, chosen(METHODS[0], gbuffer="gl")) as renderer:
            pictures = []
            for _ in range(3):
                renderer.move(told)
                pictures.append(renderer.render(1).color)
        films.append(pictures)
    for other in films[1:]:
        np.testing.assert_array_equal(films[0], other)
