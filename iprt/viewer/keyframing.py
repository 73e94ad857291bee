"""Changes of keyframes: set, moved, copied, deleted, interpolated.

Keys of one object or view differ in time, which therefore names them.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from iprt.errors import SceneError
from iprt.geometry.camera import View
from iprt.geometry.keyframes import Keyframe, ObjectKeyframe, ObjectMotion, ViewKeyframe
from iprt.geometry.smooth_motion import Interpolation

Float = NDArray[np.float64]
Key = TypeVar("Key", bound=Keyframe)

DIGITS = 3
"""Decimals of angles in degrees, as in files."""
SAME_S = 1e-6
"""Difference in seconds below which two times are the same."""


def object_key(motion: ObjectMotion, placed: Float, time_s: float) -> ObjectKeyframe:
    """Return the key that puts an object at a transform (4, 4) at a time.

    Keys cannot shear: the nearest rotation and stretch of its own axes are taken.

    Raises
    ------
    SceneError
        The scene format does not allow such a key, or it would mirror the object.
    """
    base, linear = motion.to_world[:3, :3], placed[:3, :3]
    scale = np.linalg.norm(linear, axis=0) / np.linalg.norm(base, axis=0)
    turn = linear / scale @ np.linalg.inv(base)
    if np.linalg.det(turn) <= 0.0:
        raise SceneError("no key can be set there: keys cannot mirror an object")
    return _checked(
        ObjectKeyframe,
        time=time_s,
        translation=[round(v, 7) + 0.0 for v in (placed[:3, 3] - motion.to_world[:3, 3]).tolist()],
        rotation=[v + 0.0 for v in Rotation.from_matrix(turn).as_quat(canonical=True).tolist()],
        scale=[float(f"{v:.7g}") for v in scale],
    )


def view_key(view: View, time_s: float, near_deg: float) -> ViewKeyframe:
    """Return the key of a look at a time; of all yaws that are the same, the one near another.

    Raises
    ------
    SceneError
        The scene format does not allow such a key.
    """
    look = rounded(view)
    yaw = look.yaw_deg + 360.0 * round((near_deg - look.yaw_deg) / 360.0)
    return _checked(
        ViewKeyframe,
        time=time_s,
        yaw_deg=round(yaw, DIGITS),
        pitch_deg=look.pitch_deg,
        fov_y_deg=look.fov_y_deg,
    )


def rounded(view: View) -> View:
    """Return a view with the angles that files have, its yaw from -180 to 180 degrees."""
    return replace(
        view,
        yaw_deg=round((view.yaw_deg + 180.0) % 360.0 - 180.0, DIGITS) + 0.0,
        pitch_deg=round(view.pitch_deg, DIGITS) + 0.0,
        fov_y_deg=round(view.fov_y_deg, DIGITS),
    )


def _checked(kind: type[Key], **values: Any) -> Key:
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        fault = error.errors()[0]
        raise SceneError(f"no key can be set there: {fault['loc'][0]}: {fault['msg']}") from None


def with_key(keys: Sequence[Key], key: Key) -> tuple[Key, ...]:
    """Return the keys with another one, which replaces one of its time.

    It is interpolated as the key that it replaces, or the one before it.
    """
    others = [other for other in keys if abs(other.time - key.time) > SAME_S]
    before = [other for other in keys if other.time <= key.time + SAME_S]
    if before:
        key = key.model_copy(update={"interpolation": before[-1].interpolation})
    return _ordered([*others, key])


def without(keys: Sequence[Key], times: Collection[float]) -> tuple[Key, ...]:
    """Return the keys without these."""
    return tuple(key for key in keys if key.time not in times)


def moved(keys: Sequence[Key], times: dict[float, float]) -> tuple[Key, ...]:
    """Return the keys with other times, by their times until now.

    Raises
    ------
    SceneError
        Two keys would have the same time, or one a time before the first frame.
    """
    return _ordered(
        [key.model_copy(update={"time": times.get(key.time, key.time)}) for key in keys]
    )


def copied(keys: Sequence[Key], times: dict[float, float]) -> tuple[Key, ...]:
    """Return the keys with copies at other times, by the times of what is copied.

    Raises
    ------
    SceneError
        As `moved`.
    """
    copies = [k.model_copy(update={"time": times[k.time]}) for k in keys if k.time in times]
    return _ordered([*keys, *copies])


def interpolated(
    keys: Sequence[Key], times: Collection[float], how: Interpolation
) -> tuple[Key, ...]:
    """Return the keys with another interpolation of these."""
    update = {"interpolation": how}
    return tuple(key.model_copy(update=update) if key.time in times else key for key in keys)


def _ordered(keys: Sequence[Key]) -> tuple[Key, ...]:
    found = tuple(sorted(keys, key=lambda key: key.time))
    if found and found[0].time < 0.0:
        raise SceneError("keys cannot be before the first frame")
    for before, after in pairwise(found):
        if after.time - before.time <= SAME_S:
            raise SceneError(f"there is a key at {after.time:g} s already; delete it first")
    return found
