"""The methods by which programs control a viewer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from iprt.errors import IprtError
from iprt.files.message_text import printable
from iprt.geometry.camera import View
from iprt.output.picture import check_output, write_picture, write_pixels
from iprt.viewer.labels import comparisons
from iprt.viewer.lens import BUFFERS
from iprt.viewer.object_states import ObjectState
from iprt.viewer.pose_parts import angles_of
from iprt.viewer.program.arguments import (
    Fov,
    Frames,
    Pitch,
    Positive,
    Size,
    Yaw,
    sized,
)
from iprt.viewer.program.changes import Change, changed_settings
from iprt.viewer.program.checked import checked
from iprt.viewer.program.edit_control import EditControl
from iprt.viewer.program.pictures import picture_at_rest
from iprt.viewer.screenshots import metadata_of
from iprt.viewer.session import Shown
from iprt.viewer.state import REST_FRAMES, Request
from iprt.viewer.ui_state import UiState

PICTURE_S = 600.0
"""Longest wait for a picture, by default."""
NONE = "none"


class Control(EditControl):
    """Control of a viewer by a program; all methods are thread-safe.

    Edits, the video and settings are shared by all windows. Directions and `display` concern each
    window; they apply to all that are open, and to browsers that come later. Pictures show the
    view and the objects of the newest window. All methods raise `IprtError` for wrong arguments.

    Parameters
    ----------
    engine : Engine
    windows : Windows
    """

    # The viewer -------------------------------------------------------------------------------

    @checked
    def status(self) -> dict[str, Any]:
        """Return the state of the viewer, as plain data."""
        engine, seen = self._engine, self._windows.seen
        view, status = seen.view, engine.status
        return {
            "scene": engine.scene.name,
            "folder": str(engine.scene.root.absolute()),
            "doing": status.text,
            "problems": [*status.problems, *status.notes],
            "view": {
                "projection": view.projection,
                "yaw": round(view.yaw_deg, 3),
                "pitch": round(view.pitch_deg, 3),
                "fov": round(view.fov_y_deg, 3),
                "size": [view.width, view.height],
            },
            "objects": {state.name: self._described(state) for state in self._objects()},
            "frame": engine.playback.frame,
            "playing": engine.playback.playing,
            "unsaved": list(engine.unsaved),
        }

    def _described(self, state: ObjectState) -> dict[str, Any]:
        return {
            "position": np.round(state.pivot, 4).tolist(),
            "rotation": (np.round(angles_of(state), 3) + 0.0).tolist(),
            "size": round(float(state.size.max()), 4),
            "shown": self._shows(state),
        }

    @checked
    def quit(self, *, discard: bool = False) -> None:
        """Close the viewer.

        Parameters
        ----------
        discard : bool
            Close it even if edits are lost.
        """
        if self._engine.unsaved and not discard:
            names = ", ".join(self._engine.unsaved)
            raise IprtError(f"quit: edits are not saved: {names}; save or discard them")
        self._leave()

    def _leave(self) -> None:
        self._windows.leave()

    # The view ---------------------------------------------------------------------------------

    @checked
    def look(
        self,
        view: str | None = None,
        *,
        yaw: Yaw | None = None,
        pitch: Pitch | None = None,
        fov: Fov | None = None,
    ) -> None:
        """Turn all windows to a view of the scene, or in a direction.

        Parameters
        ----------
        view : str, optional
            Name of a view of the scene, whose objects are shown.
        yaw, pitch : float, optional
            Direction in degrees, to the right and up; by default as it is.
        fov : float, optional
            Vertical field of view in degrees; by default as it is.
        """
        given = {"yaw_deg": yaw, "pitch_deg": pitch, "fov_y_deg": fov}
        parts = {name: value for name, value in given.items() if value is not None}
        if (view is None) == (not parts):
            raise IprtError("look: give the name of a view, or any of yaw, pitch and fov")
        if view is not None:
            self._go_to(view)
            return
        direction: dict[str, Any] = {"projection": "perspective", **parts}
        wanted = replace(self._windows.seen.view, **direction)
        self._windows.begin(replace(self._windows.start, view=wanted))
        self._everywhere(lambda ui: ui.look(wanted))

    def _go_to(self, name: str) -> None:
        views = self._engine.scene.views
        if name not in views:
            known = ", ".join(views) or NONE
            raise IprtError(f"look: no view is named '{printable(name)}'; the views are: {known}")
        entry = views[name]
        start = replace(self._windows.start, view=entry.view, objects=entry.objects)
        self._windows.begin(start)
        self._everywhere(lambda ui: ui.go_to(name))

    @checked
    def display(
        self,
        *,
        exposure: float | None = None,
        curve: Literal["srgb", "filmic"] | None = None,
        buffer: str | None = None,
        against: str | None = None,
        split: float | None = None,
        error: bool | None = None,
    ) -> None:
        """Change how all windows display pictures; omitted values stay.

        Parameters
        ----------
        exposure : float, optional
            Stops on top of the scene's exposure.
        curve : {"srgb", "filmic"}, optional
        buffer : str, optional
            Auxiliary picture to show, as of `iprt render --aov`; "none" for the picture itself.
        against : str, optional
            What to compare with: "input", "truth", the name of a method, or "none".
        split : float, optional
            Position of the division as a fraction of the width.
        error : bool, optional
            Show the difference of both pictures instead of both.
        """
        for name, value, known in (
            ("buffer", buffer, BUFFERS),
            ("against", against, comparisons()),
        ):
            if value is not None and value != NONE and value not in known:
                words = ", ".join([NONE, *known])
                raise IprtError(f"display: {name} '{printable(value)}': expected one of {words}")
        given: dict[str, Any] = {
            "exposure_ev": exposure,
            "curve": curve,
            "buffer": buffer,
            "against": against,
            "split": split,
            "error": error,
        }
        parts: dict[str, Any] = {
            name: None if value == NONE else value
            for name, value in given.items()
            if value is not None
        }

        def show(ui: UiState) -> None:
            ui.viewport.lens = replace(ui.viewport.lens, **parts)

        start = self._windows.start
        self._windows.begin(replace(start, lens=replace(start.lens, **parts)))
        self._everywhere(show)

    # The video and settings -------------------------------------------------------------------

    @checked
    def play(self) -> None:
        """Play the video, from the start if it is at its end."""
        if len(self._engine.scene.frame_indices) == 1:
            raise IprtError(f"play: {self._engine.scene.name} has a single frame")
        self._engine.play()

    @checked
    def pause(self) -> None:
        """Pause at the current frame."""
        self._engine.pause()

    @checked
    def seek(self, frame: int) -> None:
        """Go to the nearest existing frame; a playing video continues from there."""
        self._engine.seek(frame)

    @checked
    def set(self, *changes: Change) -> None:
        """Change settings.

        Parameters
        ----------
        *changes : str, dict or Settings
            Each is an assignment such as "trace.rays=4", a dictionary of values by key, or all
            settings.
        """
        self._engine.set_settings(changed_settings(self._engine.world.settings, changes))

    # Pictures ---------------------------------------------------------------------------------

    @checked
    def picture(
        self,
        size: Size | None = None,
        *,
        frames: Frames = REST_FRAMES,
        timeout: Positive = PICTURE_S,
    ) -> NDArray[np.float32]:
        """Return the linear radiance (H, W, 3) of the picture at rest.

        Parameters
        ----------
        size : (width, height), optional
            In pixels; by default the window's.
        frames : int
            View frames to which it is refined.
        timeout : float
            Longest wait in seconds, which includes the compilation of kernels.
        """
        return self._rest(size, frames, timeout).picture.color

    @checked
    def render(
        self,
        file: Path,
        size: Size | None = None,
        *,
        frames: Frames = REST_FRAMES,
        timeout: Positive = PICTURE_S,
    ) -> None:
        """Write the picture at rest to a file: as displayed to .png, as linear radiance to .exr.

        Parameters
        ----------
        file : path
        size, frames, timeout
            See `picture`.
        """
        check_output(file)
        scene = self._engine.scene
        scene.require_not_ours(file)
        shown = self._rest(size, frames, timeout)
        color, metadata = shown.picture.color, metadata_of(self._engine, shown)
        if file.suffix.lower() == ".png":
            pixels = self._windows.seen.lens.develop(color, scene.exposure)
            write_pixels(file, pixels, metadata=metadata)
        else:
            write_picture(file, color, metadata=metadata)

    def _rest(self, size: tuple[int, int] | None, frames: int, timeout_s: float) -> Shown:
        seen = self._windows.seen
        view: View = sized(seen.view, size)
        request = Request(view, seen.objects, geometry=False, frames=frames)
        return picture_at_rest(self._engine, request, timeout_s)
