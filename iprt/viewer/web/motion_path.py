"""The path of the selected object, drawn by the browser over the picture."""

from __future__ import annotations

from typing import Any

import numpy as np

from iprt.viewer.web.browser_state import BrowserState

NAME, KEYS_NAME = "/path", "/keys"
PATH_RGB, KEY_RGB = (237, 158, 61), (255, 255, 255)
WIDTH_PX = 2.0
KEY_SHARE = 0.005
"""Size of the dots at keys, relative to their distance."""


class MotionPath:
    """The path that keyframes move the selected object along, with dots at the keys."""

    def __init__(self, ui: BrowserState) -> None:
        self._ui = ui
        self._handles: list[Any] = []
        self._shown: bytes | None = None

    def sync(self) -> None:
        """Draw the path of the primary object, if it has keys."""
        ui, state = self._ui, self._ui.state
        if state is None or not state.keyframed:
            self._remove()
            return
        points, at_keys = (places - ui.centre for places in ui.timeline.path(state))
        shown = points.tobytes()
        if shown == self._shown:
            return
        self._remove()
        self._shown = shown
        scene = ui.client.scene
        segments = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)
        if len(segments):
            self._handles.append(
                scene.add_line_segments(
                    NAME, segments, PATH_RGB, thickness=WIDTH_PX, thickness_units="screen"
                )
            )
        size = KEY_SHARE * float(np.linalg.norm(at_keys, axis=1).mean())
        self._handles.append(
            scene.add_point_cloud(
                KEYS_NAME,
                at_keys.astype(np.float32),
                KEY_RGB,
                point_size=size,
                point_shape="circle",
                precision="float32",
            )
        )

    def _remove(self) -> None:
        for handle in self._handles:
            handle.remove()
        self._handles, self._shown = [], None
