"""The form of a render: frames, size, quality and file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from iprt.errors import IprtError
from iprt.files.kinds import FRAME_PATTERN
from iprt.files.safe_reading import MAX_SIDE
from iprt.geometry.camera import View
from iprt.render_check import MAX_FRAMES, default_frames
from iprt.settings.presets import CONVERGED, Quality
from iprt.viewer.controls import with_preset
from iprt.viewer.labels import Label
from iprt.viewer.render_order import RenderOrder
from iprt.viewer.screenshots import default_folder, free_path
from iprt.viewer.ui_state import UiState

What = Literal["frame", "clip", "range"]
ENDINGS: Mapping[str, Label] = {
    ".png": Label("PNG", "A picture as displayed, in the standard tone curve."),
    ".exr": Label("EXR", "A picture in linear radiance."),
    ".mp4": Label("MP4", "A video that plays everywhere."),
    ".mov": Label("MOV", "A video, for editing on Apple's systems."),
    ".mkv": Label("MKV", "A video in Matroska's container."),
    ".%04d.png": Label("PNG, numbered", "A picture per frame, as displayed."),
    ".%04d.exr": Label("EXR, numbered", "A picture per frame, in linear radiance."),
}
"""Ends of file names."""
STILL_ENDINGS = (".png", ".exr")


class RenderForm:
    """The user's entries for a render; the rest follows the window.

    Attributes
    ----------
    first, last : int
        Ends of the range of frames.
    """

    def __init__(self, ui: UiState) -> None:
        self._ui = ui
        self._what: What = "frame"
        self._around: bool | None = None
        self._size: tuple[int, int] | None = None
        self._quality: Quality | None = None
        self._accumulate: int | None = None
        self._typed: str | None = None
        self._ending = ".png"
        self._proposed: tuple[object, str] = (None, "")
        self._checked: tuple[object, str] = (None, "")
        self.first, self.last = ui.frames[0], ui.frames[-1]

    @property
    def what(self) -> What:
        """The frames to render: this one, all, or a range."""
        return self._what

    @what.setter
    def what(self, what: What) -> None:
        self._what, self._accumulate = what, None
        if (self.ending in STILL_ENDINGS) != (what == "frame"):
            self.ending = ".png" if what == "frame" else ".mp4"
        if what != "frame" and self._quality in CONVERGED:
            self._quality = "accurate"

    @property
    def around(self) -> bool:
        """True for the whole panorama; by default, if the window shows it."""
        shown = self._ui.viewport.view.projection == "equirect"
        return shown if self._around is None else self._around

    @around.setter
    def around(self, on: bool) -> None:
        self._around, self._size = on, None

    @property
    def frames(self) -> range:
        """Numbers of the frames."""
        if self._what == "frame":
            return range(self._ui.frame, self._ui.frame + 1)
        return self._ui.frames if self._what == "clip" else range(self.first, self.last + 1)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels; by default, the scene's view has its own, others even ones.

        A whole panorama is twice as wide as high.
        """
        if self._size is not None:
            return self._size
        scene, view, name = self._ui.engine.scene, self._ui.viewport.view, self._ui.viewport.name
        if self.around:
            return scene.source.size
        if (entry := self._ui.engine.views.get(name or "")) is not None:
            return entry.view.width, entry.view.height
        return max(view.width // 2 * 2, 2), max(view.height // 2 * 2, 2)

    def resize(self, *, width: int | None = None, height: int | None = None) -> None:
        """Change the width or the height."""
        before = self.size
        if self.around:
            half = height if width is None else width // 2
            self._size = (2 * (half or 0), half or 0)
        else:
            self._size = (
                before[0] if width is None else width,
                before[1] if height is None else height,
            )

    @property
    def quality(self) -> Quality | None:
        """Preset; None for the settings of the viewer."""
        return self._quality

    @quality.setter
    def quality(self, quality: Quality | None) -> None:
        self._quality, self._accumulate = quality, None

    @property
    def accumulate(self) -> int:
        """View frames per picture; by default as many as for `iprt render`."""
        quality = self._quality or "balanced"
        default = default_frames(quality, video=self._what != "frame")
        return default if self._accumulate is None else self._accumulate

    @accumulate.setter
    def accumulate(self, frames: int) -> None:
        self._accumulate = frames

    # The file ---------------------------------------------------------------------------------

    @property
    def file(self) -> str:
        """The file as typed; by default a new name in the folder of screenshots."""
        return self._proposal() if self._typed is None else self._typed

    @file.setter
    def file(self, text: str) -> None:
        self._typed = text

    @property
    def ending(self) -> str:
        """End of the file's name, usually one of `ENDINGS`."""
        if self._typed is None:
            return self._ending
        path = Path(self._typed)
        return (".%04d" if FRAME_PATTERN.search(path.stem) else "") + path.suffix.lower()

    @ending.setter
    def ending(self, ending: str) -> None:
        if self._typed is not None:
            path = Path(self._typed)
            stem = FRAME_PATTERN.sub("", path.stem).rstrip("._-") or "picture"
            self._typed = str(path.with_name(stem + ending))
        self._ending = ending

    def _proposal(self) -> str:
        """Return the name of a file that does not exist and that no render writes."""
        ui, ending = self._ui, self._ending
        name = "equirect" if self.around else ui.viewport.name
        outputs = [str(render.order.output) for render in ui.engine.renders.renders]
        key = ending, name, outputs
        if key != self._proposed[0]:

            def taken(path: Path) -> bool:
                stem = path.name.removesuffix(ending)
                return str(path) in outputs or any(path.parent.glob(f"{stem}.*"))

            path = free_path(ui.engine.scene.name, name, ending, None, taken)
            self._proposed = key, path.name
        return self._proposed[1]

    @property
    def place(self) -> str:
        """The folder of the file, in words."""
        return f"to {self._path().parent}"

    def _path(self) -> Path:
        # Unlike `Path.expanduser`, it leaves unknown users' folders as they are.
        return default_folder() / os.path.expanduser(self.file.strip())

    # The order --------------------------------------------------------------------------------

    @property
    def problem(self) -> str:
        """Why this cannot be rendered, in one line; empty if it can."""
        key = self.file, self.frames, self.size, self.around, self.accumulate, self.quality
        if key != self._checked[0]:
            try:
                self.order().check()
                problem = ""
            except IprtError as error:
                problem = str(error)
            self._checked = key, problem
        return self._checked[1]

    def submit(self) -> None:
        """Append the render to the queue; if it cannot be, `problem` tells why."""
        self._checked = None, ""
        if self.problem:
            return
        order = self.order()
        try:
            self._ui.engine.renders.add(order)
        except IprtError as error:
            self._checked = self._checked[0], str(error)
        else:
            self._typed = None
            self._ui.say(f"in the queue: {order.output}")

    def order(self) -> RenderOrder:
        """Return the order.

        Raises
        ------
        IprtError
            A value is out of its range.
        """
        ui, engine, (width, height) = self._ui, self._ui.engine, self.size
        edited = engine.edited
        if edited is None:
            raise IprtError("the scene is still being read")
        if not self.file.strip():
            raise IprtError("name a file")
        if not all(1 <= side <= MAX_SIDE for side in (width, height)):
            raise IprtError(f"{width} x {height} pixels: expected 1 to {MAX_SIDE} a side")
        if not 1 <= self.accumulate <= MAX_FRAMES:
            raise IprtError(f"{self.accumulate} view frames: expected 1 to {MAX_FRAMES}")
        frames, there = self.frames, ui.frames
        if not frames or frames[0] not in there or frames[-1] not in there:
            raise IprtError(
                f"frames {frames.start} to {frames.stop - 1}: the video has {there[0]} to "
                f"{there[-1]}, and the first comes before the last"
            )
        if self.around:
            view = View(width, height, projection="equirect")
        else:
            view = ui.viewport.view.resized(width, height)
        settings, quality = ui.settings, self.quality
        return RenderOrder(
            edited,
            view,
            self._name(),
            ui.viewport.objects,
            frames,
            self._path(),
            quality or "balanced",
            settings if quality is None else with_preset(settings, quality),
            self.accumulate,
        )

    def _name(self) -> str | None:
        """Return the scene's view to render; None for a fixed one, or the whole panorama."""
        viewport, scene = self._ui.viewport, self._ui.engine.scene
        entry = self._ui.engine.views.get(viewport.name or "")
        if entry is None or self.around:
            return None
        # A view that moves is shown as it was when it was chosen.
        now = entry.at(scene.time_of(self._ui.frame))
        view = viewport.view
        seen = now.resized(view.width, view.height) == view
        return entry.name if seen or self.what != "frame" else None
