"""What a frame of a video leaves as it was: the same as if the frame were the first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.footage.properties import Footage
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.settings.features import Features
from iprt.settings.model import Settings
from iprt.world.real.changed_surfaces import ChangedSurfaces, tile_shape
from iprt.world.real.real_world import RealWorld
from tests.oracles.worlds import Sphere, World
from tests.worlds import Radiance, bright_walls, ceiling_lamp, pose_at, room_frame

WIDTH, HEIGHT = 256, 128
COAT = Material("plastic", alpha=0.05, ior=1.5)
SEES = View(8, 8)


def frame_at(x: float, radiance: Radiance = bright_walls) -> Frame:
    """A room in which a ball hangs at x, without normals, with a glossy floor and a window."""
    world = World(solids=(Sphere((x, -0.4, -1.4), 0.25),))
    frame = room_frame(world, WIDTH, HEIGHT, radiance)
    opening = np.zeros(frame.depth.shape, bool)
    opening[50:60, 10:30] = True
    gloss = (frame.normal[..., 1] > 0.9).astype(np.uint8)
    return replace(frame, normal=None, opening=opening, gloss=gloss, real_materials=(COAT,))


def world_of(
    device: ComputeDevice, *frames: Frame, still: bool = True, video: bool = True
) -> RealWorld:
    """The real world after these frames, all of which a view has shown."""
    footage = Footage.of(frames[0], clips=False, drifts=False, video=video, static_camera=still)
    world = RealWorld(device, frames[0], Features.of([Material()], SEES, Settings(), footage))
    world.prepare()
    for frame in frames[1:]:
        world.load(frame)
        world.prepare()
    return world


def planes(device: ComputeDevice, world: RealWorld) -> dict[str, NDArray[np.generic]]:
    """What depends on the frame's surfaces alone."""
    panorama, cells = world.panorama, world.irradiance
    assert cells is not None
    buffers = {
        "inverse": panorama.surfaces.inverse,
        "surface": panorama.surface,
        "range": panorama.range,
        "cell points": cells.point,
    }
    return {name: device.read(buffer) for name, buffer in buffers.items()}


def split(device: ComputeDevice, world: RealWorld) -> dict[str, NDArray[np.generic]]:
    """What is split off the floor."""
    panorama = world.panorama
    rest = device.read(panorama.radiated)
    return {"highlight": device.read(panorama.radiance) - rest, "rest": rest}


def require_equal(
    some: dict[str, NDArray[np.generic]], others: dict[str, NDArray[np.generic]]
) -> None:
    for name, values in some.items():
        np.testing.assert_array_equal(values, others[name], err_msg=name)


@pytest.mark.parametrize("places", [(0.0, 0.3), (0.0, 0.1, 0.2, 0.3), (-0.9, 0.9)])
def test_surfaces_that_stay_keep_what_a_first_frame_would_find(
    device: ComputeDevice, places: tuple[float, ...]
) -> None:
    frames = [frame_at(x) for x in places]
    followed, fresh = world_of(device, *frames), world_of(device, frames[-1])
    require_equal(planes(device, followed), planes(device, fresh))


def test_a_still_can_be_followed_by_another(device: ComputeDevice) -> None:
    """It has given back what surfaces are made of."""
    frames = frame_at(0.0), frame_at(0.3)
    followed, fresh = world_of(device, *frames, video=False), world_of(device, frames[1])
    require_equal(planes(device, followed), planes(device, fresh))


def whole_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take every texel for changed from now on."""
    monkeypatch.setattr("iprt.world.real.surfaces.changed_tiles", lambda *_: np.array([[True]]))
    monkeypatch.setattr("iprt.world.real.surfaces.tile_side", lambda height: height)
    monkeypatch.setattr(ChangedSurfaces, "add", lambda *_: None)
    monkeypatch.setattr(ChangedSurfaces, "taken", lambda _: None)


def test_background_and_lights_are_what_whole_frames_leave(
    device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The ball goes away, and comes back; colors change in a part that grows."""
    frames = [frame_at(x) for x in (0.0, 0.1, 0.9, 0.9, 0.9, 0.05)]
    for number, frame in enumerate(frames):
        frame.color[:, : 40 * number] *= np.float32(1.0 + 0.01 * number)

    def remembered() -> dict[str, NDArray[np.generic]]:
        world = world_of(device, *frames)
        background, lights = world.panorama.background, world.lights
        assert background is not None
        assert lights is not None
        kept = ("depth", "plane", "color", "around", "marks", "hidden_light", "surface", "range")
        buffers = {name: getattr(background, name) for name in kept}
        table = vars(lights.arguments()) | {"luminance": lights.luminance}
        buffers |= {name: table[name] for name in ("column", "share", "density", "luminance")}
        return {name: device.read(buffer) for name, buffer in buffers.items()}

    followed = remembered()
    assert followed["marks"].any()
    whole_frames(monkeypatch)
    require_equal(followed, remembered())


@pytest.mark.parametrize("gloss", [True, False])
def test_a_frame_is_not_read_back(
    device: ComputeDevice, monkeypatch: pytest.MonkeyPatch, gloss: bool
) -> None:
    """Nor does the host wait for more than the flux of its picture."""
    frames = [frame_at(x) for x in (0.0, 0.1, 0.2)]
    if not gloss:
        frames = [replace(frame, gloss=None, real_materials=()) for frame in frames]
    world = world_of(device, *frames[:2])
    before = device.profile.waits
    monkeypatch.setattr(type(device), "read", lambda *_: pytest.fail("a blocking read"))
    world.load(frames[2])
    world.prepare()
    assert device.profile.waits <= before + 1


def test_a_lamp_that_is_switched_on_shines_on_the_floor_at_once(device: ComputeDevice) -> None:
    """Rays keep their paths, and find the new light where they end."""
    dark, lit = frame_at(0.2), frame_at(0.2, ceiling_lamp)
    lit = replace(lit, depth=dark.depth)
    world = world_of(device, dark, lit)
    require_equal(split(device, world), split(device, world_of(device, lit)))


def test_the_mirror_image_of_a_ball_follows_it(
    device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = [frame_at(x) for x in (-0.3, 0.3)]
    before, followed = (split(device, world_of(device, *frames[:n])) for n in (1, 2))
    whole_frames(monkeypatch)
    anew = split(device, world_of(device, *frames))
    for name, values in followed.items():
        np.testing.assert_allclose(values, anew[name], rtol=1e-3, atol=1e-4)
    assert np.abs(before["highlight"] - anew["highlight"]).max() > 1e-2


def test_gloss_that_ends_elsewhere_is_split_as_in_a_first_frame(device: ComputeDevice) -> None:
    """Rays of a cell begin at other texels of it, however small tiles are."""
    before = frame_at(0.0)
    gloss = before.gloss.copy()
    row, column = HEIGHT - 40, WIDTH // 2  # first texel of a cell
    assert gloss[row, column]
    gloss[row, column] = 0
    after = before.recolored(gloss=gloss)
    require_equal(
        split(device, world_of(device, before, after)), split(device, world_of(device, after))
    )


def test_a_cut_and_a_camera_that_moves_leave_nothing_as_it_was(device: ComputeDevice) -> None:
    first = replace(frame_at(0.0), pose=pose_at())
    other = World(low=(-3.0, -1.2, -2.0), high=(1.5, 2.0, 2.0))
    cut = room_frame(other, WIDTH, HEIGHT, bright_walls)
    gloss = (cut.normal[..., 1] > 0.9).astype(np.uint8)
    cut = replace(
        cut, gloss=gloss, real_materials=(COAT,), normal=None, pose=pose_at((0.2, 0.0, 0.0))
    )
    world, fresh = world_of(device, first, cut, still=False), world_of(device, cut, still=False)
    require_equal(planes(device, world), planes(device, fresh))
    require_equal(split(device, world), split(device, fresh))


# Cones ----------------------------------------------------------------------------------------


def test_cones_hold_the_changed_tiles_and_the_tiles_around() -> None:
    tiles = np.zeros(tile_shape(512, 1024), bool)
    for at in ((30, 5), (31, 6), (3, 100), (60, 127)):
        tiles[at] = True
    changed = ChangedSurfaces(1024, 512)
    changed.taken()
    changed.add(tiles)
    cones = changed.taken()
    assert cones is not None
    rows, columns = tiles.shape
    edges = View(3 * columns, 3 * rows, projection="equirect").directions()
    reached = (edges @ cones[:, :3].T >= cones[:, 3]).any(-1)
    for row, column in np.argwhere(tiles):
        near = reached[3 * row - 3 : 3 * row + 6]
        assert near.take(range(3 * column - 3, 3 * column + 6), axis=1, mode="wrap").all()
    assert reached.mean() < 0.2
    assert len(changed.taken()) == 0


def test_too_much_change_is_change_everywhere() -> None:
    changed = ChangedSurfaces(64, 32)
    assert changed.taken() is None
    changed.add(None)
    assert changed.taken() is None
