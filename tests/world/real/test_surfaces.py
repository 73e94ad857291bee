"""Tangent planes that the device fits to depth, against those of NumPy, and against the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.world.real import surfaces
from iprt.world.real.panorama import Panorama
from tests.footage.test_normals import angle_deg, near_edges
from tests.kernels.tracing import panorama_of
from tests.scene.files import box_room

Picture = NDArray[np.floating]


def frame_with(depth: Picture, opening: NDArray[np.bool_] | None = None) -> Frame:
    """A frame without normals."""
    none = np.zeros(depth.shape, bool)
    color = np.ones((*depth.shape, 3), np.float32)
    return Frame(color, depth.astype(np.float32), none if opening is None else opening)


def directions(frame: Frame) -> Picture:
    return View(frame.width, frame.height, projection="equirect").directions()


def planes(device: ComputeDevice, frame: Frame) -> Picture:
    """(H, W, 3) g of the tangent planes."""
    return np.asarray(device.read(panorama_of(device, frame).surface)[..., :3])


def normals(device: ComputeDevice, frame: Frame) -> Picture:
    """Unit normals of the tangent planes; 0 where there are none."""
    g = planes(device, frame).astype(np.float64)
    return -g / np.maximum(np.linalg.norm(g, axis=-1, keepdims=True), 1e-30)


def room() -> Frame:
    return frame_with(box_room(256, 128)[0])


def tilted() -> Frame:
    """Windows at the poles reach columns half a turn away, at other depths."""
    w = directions(room())
    axes, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))
    inverse = w @ np.concatenate([axes, -axes]).T / [1.0, 1.5, 2.0, 1.2, 0.8, 1.7]
    return frame_with(1.0 / inverse.max(-1))


def with_gaps() -> Frame:
    """Screens in the room, one across the seam and one over a pole."""
    depth, _ = box_room(256, 128)
    depth[50:80, 40:120] *= 0.6
    depth[60:90, -20:] *= 0.5
    depth[60:90, :20] *= 0.5
    depth[:6, 30:160] *= 0.7
    return frame_with(depth)


def noisy() -> Frame:
    frame = with_gaps()
    noise = np.random.default_rng(2).standard_normal(frame.depth.shape)
    return frame_with(frame.depth * (1.0 + 1e-3 * noise))


def quantised() -> Frame:
    return frame_with(np.round(with_gaps().depth, 3))


def with_windows() -> Frame:
    """Openings whose depth is nearly that of the wall, and sky."""
    depth, _ = box_room(256, 128)
    opening = np.zeros(depth.shape, bool)
    opening[40:70, 100:140] = True
    opening[80:110:3, 20:60] = True
    depth = np.where(opening, 1.0002 * depth, depth)
    depth[:20, 60:] = np.inf
    depth[90, 200] = np.inf
    return frame_with(depth, opening & np.isfinite(depth))


def scattered() -> Frame:
    """Texels by themselves, and any depth at others."""
    rng = np.random.default_rng(5)
    depth = rng.uniform(0.5, 50.0, (64, 128))
    depth[:32] = np.inf
    depth[8:32:16, ::16] = 2.0
    return frame_with(depth)


FRAMES: dict[str, Callable[[], Frame]] = {
    made.__name__: made
    for made in (room, tilted, with_gaps, noisy, quantised, with_windows, scattered)
}


def accompanied(frame: Frame, normal: Picture) -> Picture:
    """Normals (H, W, 3), but where no neighbour faces within acos 0.8 of it that of the neighbour
    from whose plane the texel is off the least, if by less than 5% of its depth.
    """
    d = directions(frame)
    there = np.isfinite(frame.depth)
    with np.errstate(invalid="ignore", divide="ignore"):
        plane = normal / ((normal * d).sum(-1) * frame.depth)[..., None]
    plane[~there] = 0.0
    row = np.arange(frame.height)[:, None] * np.ones(frame.width, int)
    alone, least, found = there.copy(), np.full(there.shape, 0.05), normal.copy()
    for down, right in ((0, 1), (0, -1), (-1, 0), (1, 0)):
        other = np.roll(plane, (-down, -right), (0, 1))
        beyond = (row + down < 0) | (row + down >= frame.height)
        size = np.maximum(np.linalg.norm(other, axis=-1), 1e-30)
        facing = -(other * normal).sum(-1) / size
        inverse = (other * d).sum(-1)
        off = np.abs(inverse * np.where(there, frame.depth, 1.0) - 1.0)
        nearer = ~beyond & (inverse > 0.0) & (off < least)
        alone &= beyond | (facing <= 0.8)
        least = np.where(nearer, off, least)
        found = np.where(nearer[..., None], -other / size[..., None], found)
    return np.where(alone[..., None], found, normal)


@pytest.mark.parametrize("made", FRAMES.values(), ids=FRAMES)
def test_planes_are_those_of_numpy(device: ComputeDevice, made: Callable[[], Frame]) -> None:
    frame = made()
    found, wanted = normals(device, frame), accompanied(frame, frame.fitted_normal)
    there = np.isfinite(frame.depth)
    assert np.array_equal(found.any(-1), there)
    # What NumPy sees at a grazing angle is tilted here.
    seen = there & (-(wanted * directions(frame)).sum(-1) > 0.021)
    error = np.radians(angle_deg(found, wanted)[seen])
    assert np.median(error) < 1e-5
    # float32 may decide otherwise about a texel at the edge of a tolerance.
    assert (error > 1e-3).mean() < 2e-3
    # Planes go through the depth.
    through = (planes(device, frame) * directions(frame)).sum(-1)[there] * frame.depth[there]
    np.testing.assert_allclose(through, 1.0, rtol=2e-5)


def test_planes_of_a_room_are_its_walls(device: ComputeDevice) -> None:
    depth, normal = box_room(256, 128)
    error = angle_deg(normals(device, frame_with(depth)), normal)
    assert error.max() < 2.0
    assert np.percentile(error, 99.9) < 0.1
    assert error[[0, -1]].max() < 1e-3, "poles"
    assert error[:, [0, -1]].max() < 1e-3, "seam"
    assert error[~near_edges(normal)].max() < 0.01


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_a_sphere_faces_its_centre(device: ComputeDevice, scale: float) -> None:
    frame = frame_with(np.full((64, 128), 3.0 * scale))
    assert angle_deg(normals(device, frame), -directions(frame)).max() < 1.0


def test_given_normals_hold_where_they_are_any(device: ComputeDevice) -> None:
    """Given normals may have any length and side; elsewhere normals are fitted."""
    depth, normal = box_room(96, 48)
    depth[:3] = np.inf
    turned = np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    # Others than those of the depth.
    other = normal @ turned
    frame = frame_with(depth)
    other *= np.where((other * directions(frame)).sum(-1) > 0.0, -1.0, 1.0)[..., None]
    given = (3.0 * other).astype(np.float32)
    given[10] *= -1.0
    given[20] = 0.0
    given[21] = np.nan
    given[22] = np.inf
    found = normals(device, replace(frame, normal=given))
    fitted = normals(device, frame)
    steep = -(other * directions(frame)).sum(-1) > 0.021
    steep[:3] = False
    steep[20:23] = False
    assert steep.mean() > 0.6
    np.testing.assert_allclose(found[steep], other[steep], atol=1e-5)
    np.testing.assert_array_equal(found[20:23], fitted[20:23])
    assert not found[:3].any()


def layers(device: ComputeDevice, frame: Frame) -> Picture:
    """(H, W, 6): planes, flags and leaf ranges; infinity as -1."""
    panorama: Panorama = panorama_of(device, frame)
    texels = panorama.width * panorama.height
    range_ = device.read(panorama.range)[:texels].reshape(panorama.height, panorama.width, 2)
    made = np.concatenate([device.read(panorama.surface), range_], axis=-1)
    return np.where(np.isinf(made), -1.0, made)


@pytest.mark.parametrize("size", [(8, 4), (17, 9), (31, 16), (128, 64)], ids=str)
def test_texels_taken_at_once_do_not_matter(
    device: ComputeDevice, size: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(3)
    depth, _ = box_room(*size)
    depth[rng.random(depth.shape) < 0.05] = np.inf
    depth[rng.random(depth.shape) < 0.05] *= 0.5
    frame = frame_with(depth, (rng.random(depth.shape) < 0.1) & np.isfinite(depth))
    found = []
    for wide in (True, False):
        monkeypatch.setattr(ComputeDevice, "wide", property(lambda _, wide=wide: wide))
        found.append(layers(device, frame))
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6, atol=1e-6)


def test_bands_do_not_matter(device: ComputeDevice, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the last one begins in the one before."""
    frame = with_gaps()
    frame = replace(frame, normal=np.where(frame.depth[..., None] > 2.0, 0.0, frame.fitted_normal))
    found = []
    for rows in (128, 50):
        monkeypatch.setattr(surfaces, "BAND_TEXELS", rows * frame.width)
        found.append(layers(device, frame))
    np.testing.assert_array_equal(*found)
