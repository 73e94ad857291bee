"""A capture centre that moves: where surfaces, their histories and reflections were before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.compositing.real_layer import RealLayer
from iprt.device.compute import ComputeDevice
from iprt.filter.signals import Signal
from iprt.filter.temporal import PLANE_TOLERANCE, Temporal
from iprt.gbuffer.guide import Guide
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.geometry.pose import camera_motion, view_from
from iprt.settings.filter import TemporalSettings
from iprt.trace.reflection_motion import ReflectionMotion
from iprt.world.real.camera_motion import CameraMotion
from iprt.world.real.panorama import Panorama
from tests.filter.gbuffer import Array, GBuffer, random_gbuffer, read, upload
from tests.oracles import temporal as oracle
from tests.oracles.worlds import Box, World
from tests.worlds import Float, bright_walls, filmed, landscape_frame, pose_at

ROOM = World(solids=(Box((0.8, -0.9, -1.4), (0.3, 0.5, 0.25), 0.6),))
STEPS = {
    "aside": (pose_at((0.1, 0.0, 0.2)), pose_at((0.25, -0.05, 0.1))),
    "ahead": (pose_at((0.0, 0.0, 0.1), 20.0), pose_at((0.0, 0.0, -0.2), 20.0)),
    "turned": (pose_at((0.1, 0.1, 0.0), 10.0, 5.0), pose_at((0.1, 0.1, 0.0), 27.0, -4.0)),
    "both": (pose_at((0.2, 0.1, -0.3), -70.0, 12.0), pose_at((0.1, 0.2, -0.2), -55.0, -20.0)),
}
VIEWS = [View(64, 48, 20.0, -15.0, fov_y_deg=80.0), View(96, 48, projection="equirect")]
steps = pytest.mark.parametrize("step", STEPS)
views = pytest.mark.parametrize("view", VIEWS, ids=lambda view: view.projection)


def followed(device: ComputeDevice, before: Float, now: Float) -> CameraMotion:
    """A camera in the frame after it has moved."""
    camera = CameraMotion(device, before)
    camera.step(before)
    camera.step(now)
    return camera


def seen_motion(device: ComputeDevice, frame: object, view: View, before: Float) -> Array:
    """(H, W, 2) motion and (H, W) depth of the real layer."""
    panorama = Panorama(device, frame.width, frame.height)
    panorama.load(frame)
    layout = PlaneLayout.of(view)
    camera = followed(device, before, frame.pose)
    layer = RealLayer(device, layout, name="real", camera=camera.rows)
    constants = (view_from(view, p).kernel_constants() for p in (frame.pose, before))
    layer.run(panorama, *(device.upload("view", c) for c in constants))
    return np.moveaxis(read(device, layout, layer.motion), 0, -1)


def apart(motion: Array, wanted: Array, view: View) -> Array:
    """Pixels between two image points, across the seam too."""
    step = motion - wanted
    if view.projection == "equirect":
        step[..., 0] -= view.width * np.round(step[..., 0] / view.width)
    return np.asarray(np.hypot(step[..., 0], step[..., 1]))


@views
@steps
def test_motion_is_where_the_point_was_seen(device: ComputeDevice, step: str, view: View) -> None:
    """The room's own points, projected into the view from where the camera was."""
    before, now = STEPS[step]
    frame = filmed(ROOM, 256, 128, bright_walls, now)
    motion = seen_motion(device, frame, view, before)
    d = view_from(view, now).directions() @ now[:3, :3].T
    t, _, which = ROOM.first_hit(now[:3, 3], d)
    point = now[:3, 3] + t[..., None] * d
    wanted = view_from(view, before).project((point - before[:3, 3]) @ before[:3, :3])
    inside = (np.abs(wanted - [view.width / 2, view.height / 2]) < view.width).all(-1)
    walls = inside & (which == 0)
    assert walls.mean() > 0.6
    error = apart(motion, wanted, view)
    # Texels at edges of the room and of the box show the plane on their other side.
    assert (error[walls] < 0.02).mean() > 0.94
    assert (error[inside] < 0.02).mean() > 0.88
    still = np.stack(np.meshgrid(*(np.arange(n) + 0.5 for n in (view.width, view.height))), -1)
    if step != "turned" or view.projection == "equirect":
        assert np.median(apart(motion, still, view)[inside]) > 0.5


@steps
def test_the_sky_moves_as_what_is_far(device: ComputeDevice, step: str) -> None:
    before, now = STEPS[step]
    frame = replace(landscape_frame(64, 32), pose=now)
    view = VIEWS[1]
    motion = seen_motion(device, frame, view, before)
    sky = view.directions()[..., 1] > 0.1
    wanted = view.project(view.directions() @ (before[:3, :3].T @ now[:3, :3]).T)
    assert apart(motion, wanted, view)[sky].max() < 1e-2


def test_motion_ends_when_the_camera_stops(device: ComputeDevice) -> None:
    before, now = STEPS["both"]
    camera = followed(device, before, now)
    np.testing.assert_allclose(
        device.read(camera.rows).reshape(3, 4), camera_motion(before, now), atol=1e-6
    )
    camera.step(now)
    np.testing.assert_array_equal(device.read(camera.rows).reshape(3, 4), np.eye(4)[:3])


@pytest.mark.parametrize("equirect", [False, True])
def test_histories_are_fetched_in_the_axes_they_were_kept_in(
    device: ComputeDevice, equirect: bool
) -> None:
    """Random surfaces; planes and normals are compared as the twin compares them."""
    rng = np.random.default_rng(3)
    width, height = 48, 32
    motion = camera_motion(*STEPS["both"])
    before = random_gbuffer(width, height, equirect=equirect)
    # The same picture in the axes of the camera that has moved.
    back = np.linalg.inv(np.concatenate([motion, [[0.0, 0.0, 0.0, 1.0]]]))
    position = np.einsum("ij,jhw->ihw", back[:3, :3], before.position) + back[:3, 3, None, None]
    normal = np.einsum("ij,jhw->ihw", back[:3, :3], before.normal)
    guide = Guide(
        device, before.layout, name="test",
        camera=followed(device, *STEPS["both"]).rows,
    )  # fmt: skip
    settings = TemporalSettings()
    temporal = Temporal(device, [Signal("test", "diffuse", guide)], settings)
    level = device.upload("level", before.layout.padded(np.zeros((1, height, width), np.uint8)))
    y, x = np.mgrid[:height, :width] + 0.5
    fetched = np.stack([x, y]) + rng.normal(size=(2, height, width)) * 0.8
    first = rng.random((3, height, width))
    lost = np.full_like(first, np.nan)

    before.fill(device, guide)
    still = upload(device, before.layout, np.stack([x, y]))
    samples = [upload(device, before.layout, first)]
    temporal.run(samples, [still], [level], fading=0.0, changed=False)
    guide.current, guide.previous = guide.previous, guide.current
    planes = np.concatenate([normal, position, before.seen_ids[None]])
    device.write(guide.current, before.layout.padded(planes).astype(np.float32))
    (result,) = temporal.run(
        [upload(device, before.layout, lost)], [upload(device, before.layout, fetched)], [level],
        fading=0.0, changed=False,
    )  # fmt: skip
    ids = before.seen_ids
    history = oracle.History(first * (ids > 0), (ids > 0) * 1.0, np.zeros(ids.shape))
    limits = (PLANE_TOLERANCE, settings.normal_agreement)
    # In the twin, both are in the axes of the camera as it was; only tolerances are relative to
    # distances from where it is.
    wanted = oracle.reproject(before.planes, before.planes, fetched, history, limits, equirect)
    found = read(device, before.layout, result.signal)[:3]
    close = np.isclose(found, wanted.signal, rtol=2e-3, atol=2e-4).all(0)
    assert (ids > 0).mean() > 0.5
    assert (wanted.length > 0).sum() > 0.5 * (ids > 0).sum()
    assert close.mean() > 0.95


def test_reflections_are_where_their_images_were_seen(device: ComputeDevice) -> None:
    """The image in a flat mirror stands still behind it while the camera passes."""
    view, hit = View(64, 48, fov_y_deg=50.0), 1.5
    before, now = pose_at(), pose_at((0.12, 0.05, -0.08), 3.0)

    def mirror(pose: Float) -> GBuffer:
        """The plane z = -2 of the world."""
        seen = view_from(view, pose)
        d = seen.directions() @ pose[:3, :3].T
        depth = (-2.0 - pose[2, 3]) / d[..., 2]
        normal = np.array([0.0, 0.0, 1.0]) @ pose[:3, :3]
        return GBuffer(
            seen, normal[:, None, None] * np.ones(depth.shape), depth, np.ones(depth.shape)
        )

    first, second = mirror(before), mirror(now)
    guide = Guide(device, first.layout, name="test", camera=followed(device, before, now).rows)
    first.fill(device, guide)
    second.fill(device, guide)
    direction = second.view.directions() @ now[:3, :3].T
    surface = now[:3, 3] + direction * second.depth[..., None]
    image = surface + hit * direction
    at, wanted = (
        np.moveaxis(first.view.project(p - before[:3, 3]), -1, 0) for p in (surface, image)
    )
    planes = (at, np.zeros((1, 48, 64)), np.full((1, 48, 64), hit))
    result = read(device, first.layout, ReflectionMotion(device, guide, glass=False).run(
        *(upload(device, first.layout, p) for p in planes),
        device.upload("view", first.view.kernel_constants()),
    ))  # fmt: skip
    inside = ((wanted > 4) & (wanted < np.array([60, 44])[:, None, None])).all(0)
    inside &= ((at > 4) & (at < np.array([60, 44])[:, None, None])).all(0)
    assert inside.sum() > 1000
    np.testing.assert_allclose(result[:, inside], wanted[:, inside], atol=0.03)
    assert np.abs(at - wanted)[:, inside].max() > 0.5
