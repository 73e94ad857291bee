"""The path-traced truth of the views that a window compares with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from iprt.errors import IprtError
from iprt.geometry.camera import View
from iprt.measure.view_truth import Target, read_target, truth_indices
from iprt.scene.scene import Scene
from iprt.viewer.session import Shown


class Truth:
    """Reads truths, and keeps the last one."""

    def __init__(self) -> None:
        self._key: tuple[object, ...] = ()
        self._found: Target | str = ""

    def view(self, scene: Scene, name: str, window: View) -> View:
        """The view to render to compare with a truth.

        Parameters
        ----------
        name : str
            Name of the view in the scene.
        window : View
            What would be rendered otherwise: the truth is made as small as that, or smaller, by a
            whole number where there is one that divides it.
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
        """Linear radiance (H, W, 3) as large as the picture that is shown; or why there is none."""
        view = shown.request.view
        key = (scene, name, shown.frame, view.width, view.height)
        if key != self._key:
            self._key, self._found = key, _read(scene, name, shown)
        return self._found if isinstance(self._found, str) else self._found.radiance


def truth_problem(scene: Scene, name: str | None, frame: int) -> str | None:
    """Why there is no truth of a view in a frame of the video; None: there is one."""
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
