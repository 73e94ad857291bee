"""Normals fitted to depth, against analytic surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from iprt.footage.depth_noise import fit_tolerance
from iprt.footage.frame import Frame
from iprt.footage.normals import estimate_normals, over_poles, sanitize_normals
from tests.scene.files import box_room, directions


def angle_deg(a: NDArray[np.floating], b: NDArray[np.floating]) -> NDArray[np.float64]:
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1)))


def fit(depth: NDArray[np.floating]) -> NDArray[np.float32]:
    return estimate_normals(
        depth.astype(np.float32), np.zeros(depth.shape, np.uint8), fit_tolerance(depth)
    )


def near_edges(normal: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Texels so close to an edge of the room that a strip of one or two texels may remain."""
    changes = np.zeros(normal.shape[:2], bool)
    for axis in (0, 1):
        changes |= (np.abs(np.diff(normal, axis=axis, prepend=normal.take([0], axis))) > 0).any(-1)
    return ndimage.binary_dilation(changes, iterations=3)


def test_box_room_is_exact_up_to_its_edges() -> None:
    depth, normal = box_room(256, 128)
    error = angle_deg(fit(depth), normal)
    assert error.max() < 2.0
    assert np.percentile(error, 99.9) < 0.1, "edges are not rounded"
    assert error[[0, -1]].max() < 1e-3, "poles"
    assert error[:, [0, -1]].max() < 1e-3, "seam"


def test_a_tilted_room_is_exact_over_its_poles() -> None:
    """The windows at the poles reach columns half a turn away, which here are at other depths."""
    w = directions(128, 64)
    axes, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))
    outward = np.concatenate([axes, -axes])
    inverse = w @ outward.T / [1.0, 1.5, 2.0, 1.2, 0.8, 1.7]
    normal = -outward[inverse.argmax(-1)]
    error = angle_deg(fit(1.0 / inverse.max(-1)), normal)
    away = ~near_edges(normal)
    assert away[[0, 1, -2, -1]].all()
    assert error[away].max() < 0.05


def test_beyond_a_pole_lies_the_other_side() -> None:
    plane = np.random.default_rng(2).random((6, 8))
    across = np.roll(plane, 4, axis=1)
    extended = over_poles(plane, 2)
    np.testing.assert_array_equal(extended, [*across[1::-1], *plane, *across[:-3:-1]])


def test_normals_are_unit_and_face_the_centre() -> None:
    rng = np.random.default_rng(5)
    depth = rng.uniform(0.5, 50.0, (32, 64))
    normal = fit(depth)
    assert np.allclose(np.linalg.norm(normal, axis=-1), 1.0, atol=1e-5)
    assert ((normal * directions(64, 32)).sum(-1) < 0).all()


def test_a_depth_gap_is_not_averaged_across() -> None:
    depth, normal = box_room(256, 128)
    screen = np.zeros(depth.shape, bool)
    screen[50:80, 40:200] = True
    w = directions(256, 128)
    plane = np.array([0.3, 0.1, -1.0])
    plane /= np.linalg.norm(plane)
    front = (w @ plane) > 0.3
    screen &= front
    clear = ~near_edges(normal) | screen
    depth = np.where(screen, 0.6 / np.where(front, w @ plane, 1.0), depth)
    normal[screen] = -plane
    error = angle_deg(fit(depth), normal)
    gap = ndimage.binary_dilation(screen, iterations=2) ^ ndimage.binary_erosion(screen)
    assert (gap & clear).sum() > 300
    assert error[clear].max() < 0.1


def test_sphere_around_the_centre_faces_it() -> None:
    normal = fit(np.full((64, 128), 3.0))
    assert angle_deg(normal, -directions(128, 64)).max() < 1.0


@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_scale_does_not_matter(scale: float) -> None:
    depth, normal = box_room(256, 128)
    assert np.percentile(angle_deg(fit(scale * depth), normal), 99.9) < 0.1


def test_quantised_and_noisy_depth_still_give_normals() -> None:
    depth, normal = box_room(256, 128)
    assert np.median(angle_deg(fit(np.round(depth, 3)), normal)) < 0.2
    noisy = depth * (1 + 1e-3 * np.random.default_rng(2).standard_normal(depth.shape))
    assert np.median(angle_deg(fit(noisy), normal)) < 1.5


def test_noise_matters_no_more_at_the_poles() -> None:
    """Windows are as wide there, in more columns."""
    depth, normal = box_room(256, 128)
    noisy = depth * (1 + 1e-4 * np.random.default_rng(3).standard_normal(depth.shape))
    error = angle_deg(fit(noisy), normal)
    assert np.median(error[4:12]) < 1.5 * np.median(error[20:28])


def test_a_mirrored_room_has_mirrored_normals() -> None:
    depth, _ = box_room(256, 128)
    depth[40:80, 30:55] = 0.9
    mirrored = fit(depth[:, ::-1])[:, ::-1] * np.array([-1.0, 1.0, 1.0], np.float32)
    np.testing.assert_allclose(mirrored, fit(depth), atol=1e-4)


def test_no_surface_no_normal_and_no_influence() -> None:
    depth, normal = box_room(128, 64)
    depth[:20] = np.inf
    found = fit(depth)
    assert (found[:20] == 0).all()
    assert angle_deg(found, normal)[20:][~near_edges(normal)[20:]].max() < 0.1


def test_texels_of_another_kind_do_not_bend_a_plane() -> None:
    """They lie so near to it that only their label keeps them out of its windows."""
    depth, normal = box_room(256, 128)
    kind = np.zeros(depth.shape, np.uint8)
    kind[::7] = 1
    bent = np.where(kind, 1.0002 * depth, depth).astype(np.float32)
    inside = (kind == 0) & ~near_edges(normal)
    apart, joined = estimate_normals(bent, kind, fit_tolerance(bent)), fit(bent)
    assert np.median(angle_deg(apart, normal)[inside]) < 1e-3
    assert np.median(angle_deg(joined, normal)[inside]) > 1e-2


def test_a_texel_by_itself_faces_the_centre() -> None:
    depth = np.full((64, 128), np.inf, np.float32)
    depth[8::16, ::16] = 2.0
    normal = fit(depth)
    there = np.isfinite(depth)
    np.testing.assert_allclose(normal[there], -directions(128, 64)[there], atol=1e-6)


@pytest.mark.parametrize("size", [(2, 1), (4, 2), (6, 3), (8, 4)])
def test_tiny_panoramas(size: tuple[int, int]) -> None:
    depth, _ = box_room(*size)
    assert np.allclose(np.linalg.norm(fit(depth), axis=-1), 1.0, atol=1e-5)


@pytest.mark.parametrize("texels", [slice(0, 256), slice(3, None, 7), slice(0, 0)])
def test_normals_at_texels_are_those_of_all(texels: slice) -> None:
    depth, _ = box_room(256, 128)
    frame = Frame(
        np.zeros((128, 256, 3), np.float32), depth.astype("f4"), np.zeros((128, 256), bool)
    )
    texel = np.arange(depth.size)[texels]
    some = frame.fitted_normal_at(texel)
    assert "fitted_normal" not in vars(frame)
    assert np.array_equal(some, frame.fitted_normal.reshape(-1, 3)[texel])
    given = replace(frame, normal=frame.fitted_normal)
    assert np.array_equal(given.fitted_normal_at(texel), given.fitted_normal.reshape(-1, 3)[texel])


def test_given_normals_are_repaired() -> None:
    depth, normal = box_room(64, 32)
    estimate = fit(depth)
    given = (3.0 * normal).astype(np.float32)
    given[5] *= -1.0
    given[6, :] = 0.0
    given[7, :] = np.nan
    estimate[8] = 0.0
    found = sanitize_normals(given, estimate)
    assert angle_deg(found[:6], normal[:6]).max() < 1e-3
    assert np.array_equal(found[6:8], estimate[6:8])
    assert (found[8] == 0).all()
