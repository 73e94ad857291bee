"""A sun's brightness, followed from frame to frame by its patches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.footage.daylight import Daylight
from iprt.footage.found_sun.patches import SunPatches
from iprt.footage.prepare.reading import RawFrame
from iprt.footage.prepare.stages import Preparation
from iprt.footage.sun import Sun
from iprt.geometry.camera import View
from tests.footage.sunny_rooms import SunnyRoom

TOWARDS = np.array([0.8, 0.5, 0.1]) / np.linalg.norm([0.8, 0.5, 0.1])
ROOM = SunnyRoom(TOWARDS)
FRAME = ROOM.frame(512, 256)


def under_cloud(share: float) -> np.ndarray:
    """The picture with a share of the sun's light."""
    dimmer = tuple(share * part for part in ROOM.irradiance)
    return replace(ROOM, irradiance=dimmer).frame(512, 256).color


@pytest.fixture(scope="module")
def patches() -> SunPatches:
    found = SunPatches.of(FRAME, ROOM.sun)
    assert found is not None
    return found


@pytest.mark.parametrize("share", [0.0, 0.2, 0.7, 1.0, 1.3])
@pytest.mark.parametrize("exposure", [1.0, 1.7])
def test_a_cloud_passes(patches: SunPatches, share: float, exposure: float) -> None:
    """Whatever the exposure is."""
    assert patches.share(np.float32(exposure) * under_cloud(share)) == pytest.approx(
        share, abs=0.03
    )


def test_a_thing_that_crosses_a_patch_is_no_cloud(patches: SunPatches) -> None:
    color = FRAME.color.copy()
    row, column = np.divmod(patches.lit[: len(patches.lit) // 3], 2 * patches.rows)
    color[row, column] *= np.float32(0.2)
    assert patches.share(color) == pytest.approx(1.0, abs=0.05)


def test_pairs_are_on_both_sides(patches: SunPatches) -> None:
    """All lit texels are in the sun, and all others in the shade."""
    directions = (
        View(2 * patches.rows, patches.rows, projection="equirect").directions().reshape(-1, 3)
    )
    points = ROOM.world.first_hit(np.zeros(3), directions)[0][:, None] * directions
    assert ROOM.sunlit(points[patches.lit]).mean() > 0.99
    assert ROOM.sunlit(points[patches.shaded]).mean() < 0.01


def test_pictures_may_have_another_size(patches: SunPatches) -> None:
    for width in (128, 1024):
        color = replace(ROOM, irradiance=tuple(0.4 * part for part in ROOM.irradiance)).frame(
            width, width // 2
        )
        assert patches.share(color.color) == pytest.approx(0.4, abs=0.06)


def test_there_are_none_without_patches() -> None:
    closed = SunnyRoom(TOWARDS, panes=())
    assert SunPatches.of(closed.frame(512, 256), TOWARDS) is None


def test_frames_have_the_sun_of_their_moment(patches: SunPatches) -> None:
    shares = [1.0, 0.4, 0.0, 0.8]
    depth = np.where(FRAME.opening, 0.0, FRAME.depth).astype(np.float32)
    raws = [RawFrame(under_cloud(share), depth, None) for share in shares]
    sun = Sun(ROOM.sun, ROOM.irradiance)
    preparation = Preparation(daylight=Daylight(sun, patches), drift=False)
    for frame, share in zip(preparation.frames(raws), shares, strict=True):
        assert frame.sun is not None
        np.testing.assert_allclose(
            frame.sun.irradiance, share * np.array(ROOM.irradiance), atol=0.25
        )
        np.testing.assert_array_equal(frame.sun.direction, sun.direction)
