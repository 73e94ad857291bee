"""The whole frame while the 360° camera moves through an analytic room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance
from iprt.geometry.pose import view_from
from iprt.renderer import RenderedFrame, Renderer
from iprt.settings.model import Settings
from tests.frame.whole_frame import BRASS, CLAY, METHOD, METHODS, ROOM, SATIN, SILVER, chosen, rms
from tests.worlds import Float, ball, bright_walls, cuboid, filmed, pose_at, room_frame

pytestmark = pytest.mark.gl

VIEW = View(64, 48, yaw_deg=5.0, pitch_deg=-35.0)
AOVS = ("ratio", "coverage", "background", "normal", "diffuse", "specular")


def objects() -> list[Instance]:
    return [
        ball((0.2, -1.0, -1.4), 0.3, CLAY, subdivisions=3),
        replace(ball((-0.3, -1.25, -1.1), 0.15, BRASS, subdivisions=3), name="brass"),
        cuboid((0.75, -1.2, -1.1), (0.2, 0.2, 0.15), SATIN),
        # Behind the view; with a mirror, kernels are those of other tests.
        ball((0.0, -1.3, 1.8), 0.1, SILVER, subdivisions=1),
    ]


def walk(steps: int) -> list[Float]:
    """Poses of a camera that is carried past the objects and turned meanwhile; it ends level."""
    poses = []
    for i in range(steps - 1, -1, -1):
        position = (0.15 - 0.012 * i, 0.05 + 0.006 * i, 0.1 + 0.01 * i)
        poses.append(pose_at(position, 10.0 + 0.8 * i, 0.3 * i))
    return poses


def frame_at(pose: Float) -> Frame:
    return _filmed(pose.tobytes())


@cache
def _filmed(pose: bytes) -> Frame:
    return filmed(ROOM, 256, 128, bright_walls, np.frombuffer(pose).reshape(4, 4))


def settings(**others: Any) -> Settings:
    return chosen(METHODS[0], **others)


def errors(picture: RenderedFrame, truth: RenderedFrame) -> dict[str, float]:
    """Return RMS errors of the relighting ratio and of objects' pixels."""
    real = truth.aovs["coverage"] == 0.0
    solid = (truth.aovs["coverage"] == 1.0) & (picture.aovs["coverage"] == 1.0)
    ratio = picture.aovs["ratio"] - truth.aovs["ratio"]
    return {"ratio": rms(ratio[real]), "objects": rms((picture.color - truth.color)[solid])}


# What must stay ------------------------------------------------------------------------------


@METHOD
def test_a_scene_moved_by_a_pose_looks_the_same(
    device: ComputeDevice, method: tuple[str, str]
) -> None:
    """Objects and view turned and moved along with the camera."""
    frame = room_frame(ROOM, 128, 64, bright_walls)
    pose = pose_at((3.0, -1.0, 7.0), 30.0)
    moved = [replace(i, to_world=pose @ i.to_world) for i in objects()]
    turned_view = replace(VIEW, yaw_deg=VIEW.yaw_deg + 30.0)
    pictures = []
    for scene in (
        (frame, objects(), VIEW),
        (replace(frame, pose=pose), moved, turned_view),
    ):
        with Renderer(device, *scene, chosen(method)) as renderer:
            pictures.append(renderer.render(3, AOVS))
    still, other = pictures
    # Rounding decides what single rays meet.
    assert np.isclose(other.color, still.color, rtol=0.02, atol=1e-4).mean() > 0.99
    assert rms(other.color - still.color) < 0.01
    # Normals are told in the world, which is another now.
    inside = still.aovs["coverage"] == 1.0
    normals = still.aovs["normal"][inside] @ pose[:3, :3].T
    np.testing.assert_allclose(other.aovs["normal"][inside], normals, atol=2e-3)


# What must be kept ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def truth(device: ComputeDevice) -> RenderedFrame:
    """The last frame of the walk, converged."""
    sure = settings(fading=0.0, seed=5, trace={"rays": 16, "object_rays": 16})
    with Renderer(device, frame_at(walk(1)[0]), objects(), VIEW, sure) as renderer:
        return renderer.render(8, AOVS)


def walked(
    device: ComputeDevice, poses: Sequence[Float], chosen_settings: Settings, each: int = 1
) -> tuple[RenderedFrame, NDArray[Any]]:
    """The last frame of a walk, and the samples of E_R that it has."""
    with Renderer(device, frame_at(poses[0]), objects(), VIEW, chosen_settings) as renderer:
        renderer.render(each)
        for pose in poses[1:]:
            renderer.load(frame_at(pose))
            renderer.render(each)
        assert renderer.real_world.irradiance is not None
        return renderer.render(0, AOVS), device.read(renderer.real_world.irradiance.mean)


@pytest.mark.thorough
def test_walking_leaves_no_trails(device: ComputeDevice, truth: RenderedFrame) -> None:
    """After a walk the picture has less noise than a first one, and in no place another one."""
    poses = walk(14)
    fresh = [walked(device, poses[-1:], settings(seed=seed))[0] for seed in (1, 2)]
    picture, _ = walked(device, poses, settings(seed=1))
    first = [errors(f, truth) for f in fresh]
    for name, error in errors(picture, truth).items():
        assert error < 0.85 * np.mean([found[name] for found in first]), name
    real = truth.aovs["coverage"] == 0.0
    lit = real & (truth.aovs["ratio"].min(-1) > 0.97)
    assert lit.mean() > 0.2
    found, other = (p.aovs["ratio"] - truth.aovs["ratio"] for p in (picture, fresh[0]))
    # A first frame traces each pixel, one of a walk those that objects change.
    worst, least_worst = (np.percentile(np.abs(e)[lit], 99.5) for e in (found, other))
    assert worst < 1.1 * least_worst
    np.testing.assert_allclose(picture.aovs["background"], truth.aovs["background"], atol=1e-6)


def test_objects_keep_their_place_in_the_world(device: ComputeDevice) -> None:
    """Their motion, drawn either way, follows their points past the camera."""
    before, now = walk(6)[0], walk(6)[-1]
    for gbuffer in ("gl", "cl"):
        with Renderer(
            device, frame_at(before), objects(), VIEW, settings(gbuffer=gbuffer)
        ) as renderer:
            renderer.step()
            renderer.load(frame_at(now))
            renderer.step()
            seen = renderer.visible
            image = {
                name: renderer.layout.interior(device.read(getattr(seen, name)))
                for name in ("motion", "depth", "coverage")
            }
            renderer.step()
            rested = renderer.layout.interior(device.read(seen.motion))
        solid = image["coverage"][0] == 1.0
        assert solid.sum() > 200
        here = view_from(VIEW, now)
        point = now[:3, 3] + (here.directions() * image["depth"][0][..., None]) @ now[:3, :3].T
        wanted = view_from(VIEW, before).project((point - before[:3, 3]) @ before[:3, :3])
        motion = np.moveaxis(image["motion"], 0, -1)
        np.testing.assert_allclose(motion[solid], wanted[solid], atol=0.01)
        still = np.stack(np.meshgrid(np.arange(64) + 0.5, np.arange(48) + 0.5), -1)
        assert np.abs(motion - still)[solid].mean() > 0.5
        np.testing.assert_allclose(np.moveaxis(rested, 0, -1)[solid], still[solid], atol=0.01)


# E_R -----------------------------------------------------------------------------------------


def test_irradiance_is_fetched_from_where_it_was(device: ComputeDevice) -> None:
    """Cells of a walk know what cells of a camera that stood still do."""
    poses = walk(14)
    few = settings(irradiance={"rows": 32, "rays": 4})
    many = settings(irradiance={"rows": 32, "rays": 1024, "samples": 2048})
    _, sure = walked(device, poses[-1:], many)
    _, mean = walked(device, poses, few)
    _, first = walked(device, poses[-1:], few)
    known = (first[:, 3] > 0.0) & (sure[:, 3] > 0.0)
    assert known.sum() > 80
    # 0.80 to 0.98 by the seed: in each frame, random pixels ask for their cells.
    assert (mean[known, 3] >= 2.0 * first[known, 3]).mean() > 0.75
    error, alone = (m[known, :3] - sure[known, :3] for m in (mean, first))
    assert rms(error) < 0.7 * rms(alone)
    assert abs((error / sure[known, :3]).mean()) < 0.02


def test_flux_turns_with_the_camera(device: ComputeDevice) -> None:
    """A camera that turns on the spot: what cells know of directions is in its axes."""
    poses = [pose_at(yaw_deg=12.0 * i) for i in range(3)]
    many = settings(irradiance={"rows": 32, "rays": 1024, "samples": 1024})
    _, sure = walked(device, poses[-1:], many)
    with Renderer(device, frame_at(poses[0]), objects(), VIEW, many) as renderer:
        renderer.step()
        for pose in poses[1:]:
            renderer.load(frame_at(pose))
        assert renderer.real_world.irradiance is not None
        fetched = device.read(renderer.real_world.irradiance.mean)
    known = (np.split(fetched, 2)[0][:, 3] > 0.0) & (np.split(sure, 2)[0][:, 3] > 0.0)
    assert known.sum() > 80
    found, wanted = (np.split(mean, 2)[1][known, :3] for mean in (fetched, sure))
    length, true = np.linalg.norm(found, axis=1), np.linalg.norm(wanted, axis=1)
    cosine = (found * wanted).sum(1) / (length * true)
    assert np.degrees(np.arccos(np.median(cosine))) < 4.0
    assert np.median(length / true) == pytest.approx(1.0, abs=0.05)


@pytest.mark.thorough
def test_random_numbers_go_on(device: ComputeDevice) -> None:
    """Cells that forget draw other samples: over time their values average many."""
    rows = {"rows": 32}
    frame = room_frame(ROOM, 128, 64, bright_walls)
    video = (frame, replace(frame, color=2.0 * frame.color))
    many = settings(irradiance={**rows, "rays": 1024, "samples": 2048})
    with Renderer(device, frame, objects(), VIEW, many) as renderer:
        renderer.step()
        assert renderer.real_world.irradiance is not None
        sure = device.read(renderer.real_world.irradiance.mean)
    means = []
    with Renderer(device, frame, objects(), VIEW, settings(irradiance=rows)) as renderer:
        for i in range(40):
            renderer.step()
            assert renderer.real_world.irradiance is not None
            means.append(device.read(renderer.real_world.irradiance.mean))
            means[-1][:, :3] /= (1.0, 2.0)[i % 2]
            renderer.load(video[(i + 1) % 2])
        drawn = device.read(renderer.real_world.irradiance.plane)[:, 3]
    known = np.flatnonzero((drawn > 80.0) & (np.split(sure, 2)[0][:, 3] > 0.0))
    assert len(known) > 50
    over_time = np.mean(means[5:], axis=0)[known, :3] - sure[known, :3]
    single = means[0][known, :3] - sure[known, :3]
    assert rms(over_time) < 0.4 * rms(single)
