"""Keys are set from poses and looks, moved, copied and deleted."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from iprt.errors import SceneError
from iprt.geometry.camera import View
from iprt.geometry.keyframes import ObjectKeyframe, ObjectMotion, ViewKeyframe, ViewMotion
from iprt.viewer.keyframing import (
    copied,
    interpolated,
    moved,
    object_key,
    view_key,
    with_key,
    without,
)

KEYS = tuple(
    ObjectKeyframe(time=time, translation=[time, 0.0, 0.0], interpolation=how)
    for time, how in ((0.0, "linear"), (0.5, "smooth"), (1.0, "step"))
)


def times(keys: tuple[ObjectKeyframe, ...]) -> list[float]:
    return [key.time for key in keys]


def placed(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.random(rng=rng).as_matrix() * rng.uniform(0.1, 3.0, 3)
    matrix[:3, 3] = rng.normal(size=3)
    return matrix


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6), st.sampled_from([0.0, 0.25, 0.5, 0.9, 1.0, 4.0]))
def test_a_key_of_a_pose_has_that_pose(seed: int, time: float) -> None:
    """However the object moved before: turned, moved and grown along its own axes."""
    base, turn = placed(seed), Rotation.random(rng=np.random.default_rng(seed + 1)).as_matrix()
    pose = base.copy()
    pose[:3, :3] = turn @ base[:3, :3] * np.random.default_rng(seed).uniform(0.2, 5.0, 3)
    pose[:3, 3] += 1.0
    motion = ObjectMotion.of(base, KEYS)
    keyed = ObjectMotion.of(base, with_key(KEYS, object_key(motion, pose, time)))
    np.testing.assert_allclose(keyed.at(time), pose, atol=2e-6)


def test_keys_cannot_mirror() -> None:
    with pytest.raises(SceneError, match="cannot mirror"):
        object_key(ObjectMotion(np.eye(4)), np.diag([-1.0, 1.0, 1.0, 1.0]), 0.0)
    far = np.eye(4)
    far[0, 3] = 1e9
    with pytest.raises(SceneError, match="no key can be set there: translation"):
        object_key(ObjectMotion(np.eye(4)), far, 0.0)


@pytest.mark.parametrize(("near", "yaw"), [(0.0, -170.0), (180.0, 190.0), (-700.0, -530.0)])
def test_a_key_of_a_look_turns_the_short_way(near: float, yaw: float) -> None:
    look = View(64, 32, 190.0, -20.0, 50.0)
    key = view_key(look, 0.5, near)
    assert key == ViewKeyframe(time=0.5, yaw_deg=yaw, pitch_deg=-20.0, fov_y_deg=50.0)
    found = ViewMotion.of(View(64, 32), [key]).at(0.5)
    np.testing.assert_allclose(found.world_from_view, look.world_from_view, atol=1e-9)


def test_a_new_key_goes_on_as_the_one_before() -> None:
    key = ObjectKeyframe(time=0.75, scale=[2.0, 2.0, 2.0])
    found = with_key(KEYS, key)
    assert times(found) == [0.0, 0.5, 0.75, 1.0]
    assert found[2].interpolation == "smooth"
    again = with_key(found, ObjectKeyframe(time=1.0 + 1e-9, scale=[3.0, 3.0, 3.0]))
    assert len(again) == 4
    assert (again[3].scale, again[3].interpolation) == ([3.0, 3.0, 3.0], "step")


def test_keys_are_moved_copied_and_deleted_in_order() -> None:
    assert times(moved(KEYS, {0.0: 0.75})) == [0.5, 0.75, 1.0]
    assert moved(KEYS, {0.0: 0.75})[1].translation == [0.0, 0.0, 0.0]
    assert times(moved(KEYS, {0.0: 0.5, 0.5: 1.0, 1.0: 1.5})) == [0.5, 1.0, 1.5]
    both = copied(KEYS, {0.0: 2.0, 0.5: 2.5})
    assert times(both) == [0.0, 0.5, 1.0, 2.0, 2.5]
    assert both[4] == KEYS[1].model_copy(update={"time": 2.5})
    assert times(without(KEYS, [0.5])) == [0.0, 1.0]
    assert [key.interpolation for key in interpolated(KEYS, [0.0, 1.0], "smooth")] == ["smooth"] * 3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda: moved(KEYS, {0.0: 0.5}), "there is a key at 0.5 s already"),
        (lambda: copied(KEYS, {0.0: 1.0}), "there is a key at 1 s already"),
        (lambda: moved(KEYS, {0.5: -0.5}), "before the first frame"),
    ],
)
def test_collisions_are_refused(change: object, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        change()  # type: ignore[operator]
