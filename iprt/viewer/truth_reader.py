"""Path-traced truths, for comparison with a window's view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from iprt.errors import IprtError
from iprt.geometry.camera import View
from iprt.measure.view_truth import Target, read_target, truth_indices
from iprt.scene.scene import Scene
from iprt.viewer.session import Shown


class TruthReader:
    """A reader of truths, with a cache of one."""

    def __init__(self) -> None:
        self._key: tuple[object, ...] = ()
        self._found: Target | str = ""

    def view(self, scene: Scene, name: str, window: View) -> View:
        """Return the view to render for a comparison with a truth.

        Parameters
        ----------
        name : str
            Name of the view in the scene.
        window : View
            The window's view. The truth is reduced to at most its size, by a whole number if one
            divides the truth's size.
        """
        entry = scene.views.get(name)
        if entry is None or entry.truth is None:
            return window
        own = entry.view
        for factor in range(1, min(own.width, own.height) + 1):
            width, height = own.width // factor, own.height // factor
            whole = (width * factor, height * factor) == (own.width, own.height)
            if whole and width <= window.width and height <= window.height:
                return replace(window, width=width, height=height)
        return window.resized(own.width, own.height)

    def picture(self, scene: Scene, name: str | None, shown: Shown) -> NDArray[np.float32] | str:
        """Return linear radiance (H, W, 3) at the picture's size, or the reason for its lack."""
        view = shown.request.view
        key = (scene, name, shown.frame, view.width, view.height)
        if key != self._key:
            self._key, self._found = key, _read(scene, name, shown)
        return self._found if isinstance(self._found, str) else self._found.radiance


def truth_problem(scene: Scene, name: str | None, frame: int) -> str | None:
    """Return the reason why a view has no truth in a video frame, or None if it has one."""
    if name is None:
        return "only the scene's own views have a truth: go to one"
    entry = scene.views.get(name)
    if entry is None or entry.truth is None:
        return f"view '{name}' has no truth"
    frames = truth_indices(scene, name)
    if frame not in frames:
        return f"the truth of '{name}' shows frame " + ", ".join(map(str, frames))
    return None


def _read(scene: Scene, name: str | None, shown: Shown) -> Target | str:
    problem = truth_problem(scene, name, shown.frame)
    if name is None or problem is not None:
        return problem or ""
    size = (shown.request.view.width, shown.request.view.height)
    try:
        return read_target(scene, name, "panorama", size, shown.frame)
    except IprtError as error:
        return str(error)
