"""What depth and normals tell of a place, and what is unlikely about them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.footage.depth_summary import DepthSummary, normal_warnings
from tests.scene.files import box_room, directions


def room(scale: float = 1.0, height: int = 128) -> NDArray[np.float32]:
    return (scale * box_room(2 * height, height)[0]).astype(np.float32)


def of(depth: NDArray[np.float32]) -> DepthSummary:
    found = DepthSummary.of(depth)
    assert found is not None
    return found


def test_a_room_has_its_size() -> None:
    place = of(room())
    assert place.size_m == pytest.approx((4.5, 2.7, 5.0), rel=0.02)
    assert place.floor_m == pytest.approx(1.3, rel=1e-3)
    assert place.warnings() == []
    assert place.line().endswith("2.70 m high; the camera is 1.30 m above the floor")


@pytest.mark.parametrize(
    ("scale", "message"),
    [
        (1000.0, "half of the depth is beyond 1.9"),
        (0.001, "half of the depth is nearer than 0.2 cm"),
        (0.1, "the camera is only 13.0 cm above the floor"),
    ],
)
def test_units_that_are_unlikely(scale: float, message: str) -> None:
    (warning,) = of(room(scale)).warnings()
    assert warning.startswith(message)
    assert "check depth_scale" in warning


def test_a_place_wider_than_any_is_warned_of() -> None:
    depth = room()
    far = np.random.default_rng(2).uniform(1e8, 1e9, depth.shape)
    depth[::4, ::3] = far[::4, ::3]
    (warning,) = of(depth).warnings()
    assert " km wide; a stored value that means no surface may be read as depth" in warning
    assert "depth_sky (--sky)" in warning


def test_round_places_are_not_inverted() -> None:
    w = directions(128, 64)
    ball = w @ [0.0, 0.0, -2.0]
    with np.errstate(invalid="ignore"):
        hit = np.where(ball > np.sqrt(3.0), ball - np.sqrt(ball**2 - 3.0), 4.0)
    for depth in (np.full((64, 128), 3.0), hit, 2.0 + w[..., 0]):
        place = of(depth.astype(np.float32))
        assert place.reading == "distance"
        assert place.floor_m is None
        assert "floor" not in place.line()


def test_without_depth_there_is_nothing_to_tell() -> None:
    assert DepthSummary.of(np.zeros((4, 8), np.float32)) is None


def test_normals_must_be_those_of_the_depth() -> None:
    _, normal = box_room(128, 64)
    depth = room(height=64)
    rng = np.random.default_rng(1)
    noisy = normal + rng.normal(0.0, 0.15, normal.shape)
    for good in (normal, -normal, 3.0 * normal, noisy):
        assert normal_warnings(good.astype(np.float32), depth) == []
    w = directions(128, 64)
    east = np.cross(w, [0.0, 1.0, 0.0])
    east /= np.linalg.norm(east, axis=-1, keepdims=True)
    axes = np.stack([east, np.cross(east, w), -w], axis=-2)
    camera = np.einsum("...ij,...j", axes, normal)
    turned = normal[..., [0, 2, 1]]
    for bad in (camera, turned):
        (warning,) = normal_warnings(bad.astype(np.float32), depth)
        assert "expected world space" in warning
    (warning,) = normal_warnings(np.full(normal.shape, np.nan, np.float32), depth)
    assert warning.startswith("are nowhere")
