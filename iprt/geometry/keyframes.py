"""Keyframes of objects and views: `[[objects.keyframes]]` and `[[views.keyframes]]`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Self, TypeVar

import numpy as np
import scipy
from pydantic import AfterValidator, Field, PlainValidator, model_validator

from iprt.files.toml_tables import Degrees, FieldOfView, Pitch, Point, Table
from iprt.geometry.animation import Float, Track
from iprt.geometry.camera import View
from iprt.geometry.smooth_motion import Interpolation, smooth_track

MAX_KEYFRAMES = 2**16
"""Limit for the keyframes of an object or a view."""
LARGEST_SCALE = 1e6
UNIT_TOLERANCE = 0.01
"""Tolerance of a quaternion's length, for rounded numbers in files."""


def _scale(value: Any) -> list[float]:
    """Return a scale as three factors; a single number counts for all axes."""
    values = value if isinstance(value, list) else [value] * 3
    numbers = [isinstance(v, int | float) and not isinstance(v, bool) for v in values]
    if len(values) != 3 or not all(numbers):
        raise ValueError("expected a number, or three: x, y, z")
    if not all(1.0 / LARGEST_SCALE <= v <= LARGEST_SCALE for v in values):
        raise ValueError(f"expected factors from {1.0 / LARGEST_SCALE:g} to {LARGEST_SCALE:g}")
    return [float(v) for v in values]


def _unit(values: list[float]) -> list[float]:
    length = math.hypot(*values)
    if not abs(length - 1.0) <= UNIT_TOLERANCE:
        raise ValueError(f"expected a quaternion x, y, z, w of length 1; its length is {length:g}")
    return [value / length for value in values]


def _clip(value: Any) -> str | int:
    if isinstance(value, bool) or not isinstance(value, str | int) or value in ("",):
        raise ValueError("expected the name of an animation in the glTF file, or its number")
    if isinstance(value, int) and value < 0:
        raise ValueError("expected a number from 0 on")
    return value


Clip = Annotated[str | int | None, PlainValidator(_clip)]
"""Name or index of an animation: `objects.animation`."""


class Keyframe(Table):
    """A key of a motion."""

    time: Annotated[float, Field(ge=0.0, le=1e6)]
    interpolation: Interpolation = "linear"

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        keys = [key for key in type(self).model_fields if key not in ("time", "interpolation")]
        if all(getattr(self, key) is None for key in keys):
            raise ValueError(f"says nothing but when; give {', '.join(keys[:-1])} or {keys[-1]}")
        return self


class ObjectKeyframe(Keyframe):
    """A key of an object's motion, relative to its `to_world`; omitted quantities have no key."""

    translation: Point | None = None
    rotation: (
        Annotated[list[float], Field(min_length=4, max_length=4), AfterValidator(_unit)] | None
    ) = None
    scale: Annotated[list[float] | None, PlainValidator(_scale)] = None


class ViewKeyframe(Keyframe):
    """A key of a view's motion; omitted quantities have no key."""

    yaw_deg: Degrees | None = None
    pitch_deg: Pitch | None = None
    fov_y_deg: FieldOfView | None = None


Key = TypeVar("Key", bound=Keyframe)


def _ascending(keyframes: list[Key]) -> list[Key]:
    for number in range(1, len(keyframes)):
        before, time = keyframes[number - 1].time, keyframes[number].time
        if not time > before:
            raise ValueError(f"times must ascend; [{number}] is at {time:g} s, after {before:g} s")
    return keyframes


ObjectKeyframes = Annotated[
    list[ObjectKeyframe], Field(max_length=MAX_KEYFRAMES), AfterValidator(_ascending)
]
ViewKeyframes = Annotated[
    list[ViewKeyframe], Field(max_length=MAX_KEYFRAMES), AfterValidator(_ascending)
]


@dataclass(frozen=True)
class ObjectMotion:
    """The keyframed motion of an object.

    The object is scaled along its own axes and placed by `to_world`. It is then rotated about its
    origin and translated, both along the world's axes.

    Attributes
    ----------
    to_world : (4, 4) float64
        Placement without keyframes.
    tracks : mapping of str to Track
        The keyframed ones of "translation" (metres), "rotation" and "scale".
    keyframes : tuple of ObjectKeyframe
        The keyframes that `tracks` follow.
    """

    to_world: Float
    tracks: Mapping[str, Track] = field(default_factory=dict)
    keyframes: tuple[ObjectKeyframe, ...] = ()

    @classmethod
    def of(cls, to_world: Float, keyframes: Sequence[ObjectKeyframe]) -> ObjectMotion:
        """Build a motion from the keyframes of a scene file."""
        tracks = _tracks(keyframes, ("translation", "rotation", "scale"))
        return cls(to_world, tracks, tuple(keyframes))

    def describe(self) -> str | None:
        """Describe the keyframed quantities and times in words; None without keyframes."""
        return _described(self.tracks)

    @property
    def moves(self) -> bool:
        """True if there are keyframes."""
        return bool(self.tracks)

    def at(self, time_s: float) -> Float:
        """Return the (4, 4) `to_world` at a time in seconds."""
        moved, linear, scale = self._keyed(time_s)
        placed = self.to_world.copy()
        placed[:3, :3] = linear @ self.to_world[:3, :3] * scale
        placed[:3, 3] += moved
        return placed

    def before(self, placed: Float, time_s: float) -> Float:
        """Return the (4, 4) `to_world` that leads to `placed` at a time: the inverse of `at`."""
        moved, linear, scale = self._keyed(time_s)
        to_world = placed.copy()
        to_world[:3, :3] = linear.T @ placed[:3, :3] / scale
        to_world[:3, 3] -= moved
        return to_world

    def _keyed(self, time_s: float) -> tuple[Float, Float, Float]:
        """Return the keyed translation (3,), rotation (3, 3) and scale (3,) at a time."""
        keyed = {name: track.at(time_s) for name, track in self.tracks.items()}
        turn = np.eye(3)
        if "rotation" in keyed:
            turn = scipy.spatial.transform.Rotation.from_quat(keyed["rotation"]).as_matrix()
        return keyed.get("translation", np.zeros(3)), turn, keyed.get("scale", np.ones(3))


@dataclass(frozen=True)
class ViewMotion:
    """The keyframed motion of a view.

    Attributes
    ----------
    tracks : mapping of str to Track
        The keyframed ones of "yaw_deg", "pitch_deg" and "fov_y_deg".
    keyframes : tuple of ViewKeyframe
        The keyframes that `tracks` follow.
    """

    view: View
    tracks: Mapping[str, Track] = field(compare=False)
    keyframes: tuple[ViewKeyframe, ...]

    @classmethod
    def of(cls, view: View, keyframes: Sequence[ViewKeyframe]) -> ViewMotion:
        """Build a motion from the keyframes of a scene file."""
        tracks = _tracks(keyframes, ("yaw_deg", "pitch_deg", "fov_y_deg"))
        return cls(view, tracks, tuple(keyframes))

    def describe(self) -> str | None:
        """Describe the keyframed quantities and times in words; None without keyframes."""
        return _described({name.partition("_")[0]: track for name, track in self.tracks.items()})

    def at(self, time_s: float) -> View:
        """Return the view at a time in seconds."""
        keyed: Any = {name: float(track.at(time_s)[0]) for name, track in self.tracks.items()}
        return replace(self.view, **keyed)


def _described(tracks: Mapping[str, Track]) -> str | None:
    if not tracks:
        return None
    first = min(float(track.times[0]) for track in tracks.values())
    last = max(float(track.times[-1]) for track in tracks.values())
    return f"keyframes of {', '.join(tracks)} from {first:g} to {last:g} s"


def _tracks(keyframes: Sequence[Keyframe], names: Sequence[str]) -> dict[str, Track]:
    """Return a track for each quantity that has keys."""
    tracks = {}
    for name in names:
        giving = [keyframe for keyframe in keyframes if getattr(keyframe, name) is not None]
        if not giving:
            continue
        values = np.array([getattr(keyframe, name) for keyframe in giving], np.float64)
        values = values.reshape(len(giving), -1)
        times = np.array([keyframe.time for keyframe in giving])
        how = [keyframe.interpolation for keyframe in giving]
        rotation = name == "rotation"
        if "smooth" in how[:-1]:
            # Numbers beyond their keys' could be refused, such as a pitch of 91 degrees.
            limited = name != "translation"
            tracks[name] = smooth_track(times, values, how, rotation=rotation, limited=limited)
        else:
            held = np.array([each == "step" for each in how])
            tracks[name] = Track(times, values, held, rotation=rotation)
    return tracks
