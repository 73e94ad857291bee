"""Light that was clipped is found, in rooms whose light is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.files.images import decode_srgb
from iprt.footage.frame import Frame
from iprt.footage.lights.gains import MAX_GAIN
from iprt.footage.lights.groups import Clipped, groups_of
from iprt.footage.lights.summary import Recovered
from iprt.footage.prepare.clipped_lights import ClippedLights
from iprt.geometry.equirect import solid_angles
from tests.footage.lamp_rooms import WARM, bright, clip, grey, lamp, lamp_room, srgb, tone_mapped
from tests.frame.radiosity import Lamp, Window, room
from tests.worlds import Float, sphere_frame


def flux(picture: NDArray[np.float32], where: NDArray[np.bool_]) -> Float:
    """(3,) flux at the capture centre out of some texels."""
    height, width = where.shape
    weight = np.broadcast_to(solid_angles(width, height)[:, None], where.shape)[where]
    return np.asarray((weight[:, None] * picture[where]).sum(0, dtype=np.float64))


def recovered(frame: Frame) -> NDArray[np.float32]:
    """The light of the frame, clipped at 1; what is not clipped keeps its bits, and the picture."""
    seen = clip(frame)
    found = ClippedLights(1.0)(seen)
    assert found.clipped is not None
    assert np.array_equal(found.picture, seen.color)
    assert (found.color >= found.picture).all()
    below = seen.color < 0.95
    assert np.array_equal(found.color[below], seen.color[below])
    return found.color


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("light", "walls"),
    [
        (lamp(5.0), "tiled"),
        (lamp(80.0), "colored"),
        (WARM, "colored"),
    ],
    ids=["tiled", "colored", "warm"],
)
def test_a_lamp_is_as_bright_as_it_was(light: Lamp, walls: str) -> None:
    """The color of a lamp, too, though the picture shows it white."""
    frame = lamp_room(walls, light)
    lit = bright(frame)
    assert (clip(frame).color[lit] == 1.0).mean() > 0.9
    ratio = flux(recovered(frame), lit) / flux(frame.color, lit)
    np.testing.assert_allclose(ratio, 1.0, atol=0.25)


@pytest.mark.thorough
def test_two_lamps_are_told_apart() -> None:
    dim, strong = Lamp(-1.2, -1.4, 0.4, (8.0,) * 3), Lamp(1.4, 1.5, 0.25, (40.0,) * 3)
    frame = lamp_room("colored", dim, strong)
    light = recovered(frame)
    for radiance in (8.0, 40.0):
        lit = np.abs(frame.color - radiance).max(axis=-1) < 1.0
        ratio = flux(light, lit) / flux(frame.color, lit)
        np.testing.assert_allclose(ratio, 1.0, atol=0.3)


@pytest.mark.thorough
def test_behind_a_window_the_sky_is_brighter_than_the_ground() -> None:
    def sky(d: Float) -> Float:
        return np.where(d[:, 1:2] > 0.0, 12.0, 2.5) * np.array([0.8, 0.9, 1.2])

    frame = room(grey(0.5), (), Window((-1.0, -0.6), (1.0, 0.8), sky), rows=64)
    light = recovered(frame)
    elevation = (0.5 - (np.arange(64) + 0.5) / 64)[:, None] * 180.0
    for low, high, tolerance in ((8.0, 30.0, 0.25), (-30.0, -8.0, 0.6)):
        part = frame.opening & (elevation > low) & (elevation < high)
        ratio = flux(light, part) / flux(frame.color, part)
        np.testing.assert_allclose(ratio, 1.0, atol=tolerance)
    whole = flux(light, frame.opening) / flux(frame.color, frame.opening)
    np.testing.assert_allclose(whole, 1.0, atol=0.2)


def test_the_rim_of_a_lamp_is_not_painted() -> None:
    """Where one channel is clipped and others are not, that one has lost little."""
    frame = lamp_room("gray", lamp(20.0))
    seen, lit = clip(frame), bright(frame)
    rim = lit & ~np.roll(lit, 1, axis=1)
    seen.color[rim] = (0.7, 0.8, 1.0)
    found = ClippedLights(1.0)(seen)
    np.testing.assert_array_equal(found.color[rim], seen.color[rim])
    assert found.color[lit & ~rim].min() > 10.0


@pytest.mark.thorough
def test_light_that_tone_mapping_hides() -> None:
    """A lamp that is not clipped, but shown as bright as one that is; depth as estimators see it.

    By what is clipped alone, the one would be a sixth as bright as it is.
    """
    strong, dim = 20.0, 6.0
    lamps = Lamp(-0.2, -1.4, 0.4, (dim,) * 3), Lamp(0.4, -1.4, 0.2, (strong,) * 3)
    frame = lamp_room("tiled", *lamps)
    noise = np.random.default_rng(0).normal(scale=0.005, size=frame.depth.shape)
    depth = (frame.depth * np.exp(noise)).astype(np.float32)
    seen = replace(frame, color=decode_srgb(srgb(tone_mapped(frame.color))), depth=depth)
    light = ClippedLights(1.0)(replace(seen, normal=None)).color
    for radiance in (strong, dim):
        lit = np.abs(frame.color - radiance).max(axis=-1) < 0.5
        shown = flux(seen.color, lit) / flux(frame.color, lit)
        assert (shown < 0.2).all()
        np.testing.assert_allclose(flux(light, lit) / flux(frame.color, lit), 1.0, atol=0.3)


def test_bright_walls_are_no_part_of_lamps() -> None:
    """White walls that are nearly clipped hide no light; the lamp is as bright as it was."""
    frame = lamp_room("white", lamp(80.0))
    seen = replace(frame, color=decode_srgb(srgb(frame.color)))
    assert (seen.color > 0.8).all(axis=-1).mean() > 0.2
    light, lit = ClippedLights(1.0)(seen).color, bright(frame)
    np.testing.assert_allclose(flux(light, lit) / flux(frame.color, lit), 1.0, atol=0.25)


@pytest.mark.thorough
def test_light_and_lengths_may_have_any_unit() -> None:
    factor = 2.0**10
    frame = clip(lamp_room("colored", WARM))
    plain = ClippedLights(1.0)(frame).color
    scaled = replace(frame, color=frame.color * np.float32(factor))
    brighter = ClippedLights(factor)(scaled).color
    longer = ClippedLights(1.0)(replace(frame, depth=frame.depth * np.float32(factor))).color
    assert not np.array_equal(plain, frame.color)
    np.testing.assert_allclose(brighter, plain * factor, rtol=1e-3)
    np.testing.assert_allclose(longer, plain, rtol=1e-3)


@pytest.mark.parametrize("start", [0, 20, 64, 127])
def test_panes_of_a_window_are_one_light(start: int) -> None:
    """Bars between them are bridged, at the seam too; what is a cell further is another light."""
    frame = sphere_frame(2.0, 128, 64, 0.1)
    for gap, groups in ((2, 1), (4, 2)):
        color = frame.color.copy()
        color[30:34, np.arange(start - 3, start) % 128] = 1.0
        color[30:34, np.arange(start + gap, start + gap + 3) % 128] = 1.0
        seen = replace(frame, color=color)
        clipped = Clipped.of(seen, 1.0)
        assert clipped is not None
        assert groups_of(seen, clipped).max() == groups
        # What is far is no part of what is near.
        opening = np.zeros(frame.depth.shape, bool)
        opening[:, np.arange(start, start + 40) % 128] = True
        far = replace(seen, opening=opening)
        clipped = Clipped.of(far, 1.0)
        assert clipped is not None
        assert groups_of(far, clipped).max() == 2


# What cannot be found ---------------------------------------------------------------------------


def test_nothing_clipped_changes_nothing() -> None:
    frame = lamp_room("gray", lamp(20.0))
    assert ClippedLights(float("inf"))(frame) is frame
    assert ClippedLights(25.0)(frame) is frame
    nearly = replace(frame, color=np.minimum(frame.color, np.float32(0.975)))
    assert ClippedLights(1.0)(nearly) is nearly
    assert Recovered.of(nearly, 1.0) is None


def test_all_clipped_tells_nothing() -> None:
    """What no surface shows is not made up."""
    frame = sphere_frame(2.0, 64, 32, 1.0)
    assert ClippedLights(1.0)(frame) is frame
    told = Recovered.of(frame, 1.0)
    assert told is not None
    assert told.factor == 1.0
    assert "as bright as the picture shows, because" in told.line()


@pytest.mark.thorough
@pytest.mark.parametrize("wall", [0.02, 0.3, 0.9])
def test_walls_without_shading_bound_the_light(wall: float) -> None:
    """All around the same, and a white spot: a finite guess that no surface contradicts."""
    frame = sphere_frame(2.0, 128, 64, wall)
    frame.color[28:34, 60:68] = 1.0
    found = ClippedLights(1.0)(frame)
    light = found.color
    assert np.isfinite(light).all()
    assert light.max() <= MAX_GAIN
    # Where the spot alone would light the wall brighter than it is, it is too bright.
    spot = np.zeros(frame.depth.shape, bool)
    spot[28:34, 60:68] = True
    assert (flux(light, spot) / 4.0 <= 10.0 * wall * np.pi).all()


@pytest.mark.parametrize("size", [(2, 1), (8, 4), (3, 2), (130, 65)], ids=str)
def test_any_size_and_any_noise(size: tuple[int, int]) -> None:
    rng = np.random.default_rng(1)
    width, height = size[1] * 2, size[1]
    frame = sphere_frame(2.0, width, height, 1.0)
    color = np.minimum(rng.random((height, width, 3)) * 1.2, 1.0).astype(np.float32)
    depth = rng.uniform(0.5, 50.0, (height, width)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.1] = np.inf
    normal = np.where(np.isfinite(depth)[..., None], frame.normal, np.float32(0.0))
    opening = rng.random(depth.shape) < 0.1
    found = ClippedLights(1.0)(Frame(color, depth, opening & np.isfinite(depth), normal))
    light = found.color
    assert np.isfinite(light).all()
    assert (light >= color).all()
    assert light.max() <= MAX_GAIN
