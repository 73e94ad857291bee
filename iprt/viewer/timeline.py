"""The timeline of a window: keyframes of the selected objects and of the view."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import IprtError
from iprt.geometry.smooth_motion import Interpolation
from iprt.viewer import keyframing
from iprt.viewer.engine import Engine
from iprt.viewer.object_states import ObjectState
from iprt.viewer.selection import Selection
from iprt.viewer.viewport import Viewport

Float = NDArray[np.float64]
Keys = tuple[Any, ...]
"""Keys of an object or of a view."""
Change = Callable[[Keys, list[float]], Keys]
"""Returns the changed keys of a row; the chosen ones are given by their times."""
Chosen = tuple[bool, str, float]
"""A chosen key: of a view or else of an object, of this name, at this time in seconds."""
PATH_STEPS = 96


@dataclass(frozen=True)
class Row:
    """The keys of an object or of a view.

    Attributes
    ----------
    of_view : bool
    name : str
    keys : tuple of ObjectKeyframe or of ViewKeyframe
    """

    of_view: bool
    name: str
    keys: Keys

    def key(self, time_s: float) -> Chosen:
        """Return the name of a key in a selection of keys."""
        return self.of_view, self.name, time_s


class Timeline:
    """The keyframes that a window shows and edits, for use by the interface's thread.

    Parameters
    ----------
    engine : Engine
    selection : Selection
        The selected objects.
    viewport : callable
        Returns the window's viewport.
    go_to : callable
        Switches the window to a view of the scene.
    say : callable
        `UiState.say`, which shows a line to the user.
    """

    def __init__(
        self,
        engine: Engine,
        selection: Selection,
        viewport: Callable[[], Viewport],
        go_to: Callable[[str], object],
        say: Callable[..., None],
    ) -> None:
        self._engine, self._selection, self._viewport = engine, selection, viewport
        self._go_to, self._say = go_to, say
        self._chosen: frozenset[Chosen] = frozenset()
        self._path: tuple[tuple[object, ...], Float, Float] | None = None

    # Time -------------------------------------------------------------------------------------

    def frame_of(self, time_s: float) -> float:
        """Return the frame of a time, with its fraction."""
        scene = self._engine.scene
        return float(scene.frame_indices[0] + time_s * scene.source.fps)

    def time_of(self, frame: int) -> float:
        """Return the time of a frame in seconds."""
        scene = self._engine.scene
        return float((frame - scene.frame_indices[0]) / scene.source.fps)

    @property
    def last_frame(self) -> int:
        """The last frame of the video, or of the last key if that is later."""
        keyed = [round(self.frame_of(row.keys[-1].time)) for row in self.rows if row.keys]
        return max([self._engine.scene.frame_indices[-1], *keyed])

    # Keys -------------------------------------------------------------------------------------

    @property
    def view(self) -> str | None:
        """Name of the view whose keys are set: the one that the window showed last."""
        name = self._viewport().last_name
        return name if name in self._engine.views else None

    @property
    def rows(self) -> list[Row]:
        """The view and the selected objects with their keys; the primary object is last."""
        found = []
        if (name := self.view) is not None:
            motion = self._engine.views[name].motion
            found.append(Row(True, name, () if motion is None else motion.keyframes))
        states = self._selection.states
        return [*found, *(Row(False, state.name, state.motion.keyframes) for state in states)]

    @property
    def primary(self) -> Row | None:
        """The row of the primary object, or of the view without one."""
        return next(reversed(self.rows), None)

    @property
    def chosen(self) -> frozenset[Chosen]:
        """The chosen keys that exist and are shown."""
        there = {row.key(key.time) for row in self.rows for key in row.keys}
        return self._chosen & there

    def choose(self, *keys: Chosen) -> None:
        """Choose keys, and no others."""
        self._chosen = frozenset(keys)

    def toggle(self, key: Chosen) -> None:
        """Add a key to the chosen ones, or take it out."""
        self._chosen = self.chosen ^ {key}

    # Edits ------------------------------------------------------------------------------------

    def set_key(self) -> None:
        """Set keys of the selected objects at the displayed frame, or of the view without any."""
        try:
            if self._selection.states:
                states = self._selection.unlocked()
                self._engine.animate({s.name: s.keyed(s.to_world) for s in states}, {})
            elif self.view is not None:
                self._set_view_key(self.view)
            else:
                self._say("first select an object, or add a view", bad=True)
        except IprtError as error:
            self._say(str(error), bad=True)

    def _set_view_key(self, name: str) -> None:
        viewport, motion = self._viewport(), self._engine.views[name].motion
        if viewport.view.projection == "equirect":
            self._say("the whole panorama looks everywhere: choose a view first", bad=True)
            return
        time_s = self._engine.scene.time_of(viewport.frame)
        near = viewport.view if motion is None else motion.at(time_s)
        key = keyframing.view_key(viewport.view, time_s, near.yaw_deg)
        keys = () if motion is None else motion.keyframes
        self._engine.animate({}, {name: keyframing.with_key(keys, key)})
        self._go_to(name)

    def delete(self) -> None:
        """Delete the chosen keys."""
        self._change(keyframing.without)

    def interpolate(self, how: Interpolation) -> None:
        """Change how the motion goes on from the chosen keys."""
        self._change(lambda keys, times: keyframing.interpolated(keys, times, how))

    def shift(self, frames: int, *, copy: bool = False) -> None:
        """Move the chosen keys by a number of frames, or copies of them, onto whole frames."""
        chosen = self.chosen
        later = {t: self.time_of(round(self.frame_of(t)) + frames) for _, _, t in chosen}

        def change(keys: Keys, times: list[float]) -> Keys:
            places = {time: later[time] for time in times}
            return (keyframing.copied if copy else keyframing.moved)(keys, places)

        if self._change(change):
            self.choose(*((of_view, name, later[time]) for of_view, name, time in chosen))

    def _change(self, change: Change) -> bool:
        """Change the rows of the chosen keys in one step; return False if it is impossible."""
        chosen, free = self.chosen, {state.name for state in self._selection.unlocked()}
        found: dict[bool, dict[str, Keys]] = {True: {}, False: {}}
        try:
            for row in self.rows:
                times = [key.time for key in row.keys if row.key(key.time) in chosen]
                if times and (row.of_view or row.name in free):
                    found[row.of_view][row.name] = change(row.keys, times)
        except IprtError as error:
            self._say(str(error), bad=True)
            return False
        self._engine.animate(found[False], found[True])
        return True

    # The path ---------------------------------------------------------------------------------

    def path(self, state: ObjectState) -> tuple[Float, Float]:
        """Return the path of an object's pivot, and its places at the keys.

        Returns
        -------
        (N, 3) float64
            Points in the world; none without keys.
        (K, 3) float64
        """
        motion = state.motion
        made_of = (motion.keyframes, motion.to_world.tobytes(), state.foot.tobytes())
        if self._path is None or self._path[0] != made_of:
            keys = [key.time for key in motion.keyframes]
            between = np.linspace(keys[0], keys[-1], PATH_STEPS).tolist() if keys else []
            places = {time: _apply(motion.at(time), state.foot) for time in {*keys, *between}}
            points = np.reshape([places[time] for time in sorted(places)], (-1, 3))
            at_keys = np.reshape([places[time] for time in keys], (-1, 3))
            self._path = made_of, points, at_keys
        return self._path[1:]


def _apply(to_world: Float, point: Float) -> Float:
    return np.asarray(to_world[:3, :3] @ point + to_world[:3, 3])
