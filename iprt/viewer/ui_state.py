"""State shared by the parts of one window, in both viewers: viewport and selection."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.errors import IprtError
from iprt.files.message_text import printable
from iprt.footage.sun import Sun
from iprt.geometry.camera import View
from iprt.geometry.mesh_files import MESH_SUFFIXES
from iprt.scene.light_edits import LightEdit, sun_table, towards
from iprt.scene.light_tables import LightTable, PointTable
from iprt.scene.new_light import hanging
from iprt.settings.model import Settings
from iprt.viewer.displayed_frame import DisplayedFrame
from iprt.viewer.distribution import Distribution, distribution
from iprt.viewer.engine import Engine
from iprt.viewer.labels import BY_HAND
from iprt.viewer.lens import Lens
from iprt.viewer.object_states import ObjectState
from iprt.viewer.selection import Selection, listed
from iprt.viewer.sun_arrow import ArrowPlace, SunArrow
from iprt.viewer.timeline import Timeline
from iprt.viewer.viewport import Viewport

MIDDLE = 0.5, 0.6
"""Position in the picture of objects that are not dropped on a place of it."""
FIRST_LIGHT = PointTable(kind="point", power=1.0)
ABOVE_M = 0.8
"""Height of a new light above the surface."""
FIRST_SUN_DEG = 45.0
"""Pitch of a sun that is set by hand where there was none."""


class UiState(ABC):
    """A viewport on an engine with its selection, for use by the interface's thread.

    Only `post` is thread-safe.

    Attributes
    ----------
    engine : Engine
    viewport : Viewport
    selection : Selection
    timeline : Timeline
    align : bool
        Align the +Y axis of placed objects with the surface normal.
    stepped : bool
        Gizmos move and turn in steps.
    step_m, step_deg : float
        Steps in metres and degrees.
    array_count, array_step : int and (x, y, z)
        Number and distance in metres of objects along a line (`Selection.array`).
    displayed : DisplayedFrame or None
        The displayed picture.
    """

    viewport: Viewport

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self.selection = Selection(engine, self.say)
        self.timeline = Timeline(
            engine, self.selection, lambda: self.viewport, lambda name: self.go_to(name), self.say
        )
        self._arrow_place = ArrowPlace()
        self.align = self.stepped = False
        self.step_m, self.step_deg = 0.1, 15.0
        self.array_count, self.array_step = 3, (0.5, 0.0, 0.0)
        self.displayed: DisplayedFrame | None = None
        self._distribution: tuple[DisplayedFrame, Lens, Distribution | None] | None = None
        self._posted: dict[object, Callable[[], object]] = {}

    def post(self, key: object, do: Callable[[], object]) -> None:
        """Schedule a call on the interface's thread; only the newest of each key runs."""
        self._posted[key] = do

    def run_posted(self) -> None:
        """Run the scheduled calls."""
        while self._posted:
            for key in tuple(self._posted):  # a copy, because other threads schedule meanwhile
                self._posted.pop(key)()

    @abstractmethod
    def say(self, text: str, *, bad: bool = False) -> None:
        """Show a line to the user for a while; `bad` marks a failure."""

    def go_to(self, name: str) -> None:
        """Switch to a view of the scene."""
        self.viewport.go_to(name)

    def look(self, view: View) -> None:
        """Turn to any view, at the window's size."""
        self.viewport.look(view)

    @property
    def distribution(self) -> Distribution | None:
        """Distribution of the displayed values; None without any, or without an order.

        It follows pictures at rest: in motion, the last one stays while the buffer does.
        """
        displayed, lens = self.displayed, self.viewport.lens
        if displayed is None or displayed.shown.plain:
            return None
        if (known := self._distribution) is not None:
            alike = known[1] == lens and known[0].buffer == displayed.buffer
            if alike and (known[0] is displayed or not displayed.shown.refined):
                return known[2]
        picture, name = displayed.shown.picture, displayed.buffer
        values = picture.color if name is None else picture.aovs[name]
        found = distribution(lens, name, values, self.engine.scene.exposure)
        self._distribution = displayed, lens, found
        return found

    @property
    def settings(self) -> Settings:
        """The renderer's settings, shared by all windows."""
        return self.engine.world.settings

    @settings.setter
    def settings(self, settings: Settings) -> None:
        self.engine.set_settings(settings)

    # The selection ----------------------------------------------------------------------------

    @property
    def selected(self) -> str | None:
        """Name of the primary selected object; setting it deselects all others and the sun."""
        return self.selection.primary

    @selected.setter
    def selected(self, name: str | None) -> None:
        self.selection.select(*([] if name is None else [name]))

    def select_sun(self, on: bool) -> None:
        """Select the sun, or deselect all."""
        self.selection.select()
        self.selection.sun = on

    def object_at(self, x: float, y: float) -> str | None:
        """Return the name of the object at a position in the picture, unless it is locked."""
        state = self.engine.object_state(self.viewport.picking.object_at(x, y))
        return None if state is None or state.locked else state.name

    def pick(self, name: str | None, *, more: bool) -> None:
        """Select an object; `more` adds it to the selection, or takes it out of it."""
        if not more:
            self.selected = name
        elif name is not None:
            self.selection.toggle(name)

    # The sun ----------------------------------------------------------------------------------

    @property
    def sun(self) -> Sun:
        """The sun with all edits; without one, a first sun to set by hand."""
        sun = self.engine.sun
        if sun is not None:
            return sun
        # A white surface that faces it is displayed as white.
        bright = float(np.pi / self.engine.scene.exposure)
        direction = towards(self.viewport.view.yaw_deg, FIRST_SUN_DEG)
        return Sun(np.array(direction), (bright, bright, bright))

    def choose_sun(self, choice: str) -> None:
        """Choose one of `iprt.viewer.labels.SUNS`."""
        if choice == BY_HAND:
            self.shine()
        else:
            self.engine.set_light(LightEdit(sun="auto" if choice == "auto" else "none"))

    def shine(
        self,
        *,
        direction: Sequence[float] | None = None,
        irradiance: Sequence[float] | None = None,
        angle_deg: float | None = None,
    ) -> None:
        """Set the sun by hand; parts that are not given stay.

        Raises
        ------
        SceneError
            No scene may have such a sun.
        """
        sun = self.sun
        table = sun_table(
            sun.direction.tolist() if direction is None else direction,
            sun.irradiance if irradiance is None else irradiance,
            sun.angle_deg if angle_deg is None else angle_deg,
        )
        self.engine.set_light(LightEdit(sun=table))

    def arrow(self, view: View) -> SunArrow | None:
        """Return the arrow of the selected sun in a view; None without one."""
        sun = self.engine.sun
        if sun is None or not self.selection.sun or view.projection != "perspective":
            return None
        return self._arrow_place.arrow(self.viewport.picking, view, self.centre, sun.direction)

    # Objects ----------------------------------------------------------------------------------

    @property
    def state(self) -> ObjectState | None:
        """The selected object with all edits."""
        return self.selection.state

    @property
    def centre(self) -> NDArray[np.float64]:
        """(3,) world position of the capture centre."""
        pose = None if self.displayed is None else self.displayed.shown.pose
        return np.zeros(3) if pose is None else pose[:3, 3]

    def drop(self, x: float, y: float) -> bool:
        """Move the selection to the surface at a position in the picture, if there is one.

        Returns
        -------
        bool
            True if it was placed.
        """
        state = self.state
        if state is None:
            return False
        placed = self.viewport.dropped(state, x, y, upright=not self.align)
        if placed is not None:
            self.selection.place(state, placed)
        return placed is not None

    def shine_as(self, light: LightTable) -> None:
        """Change the selected light without geometry."""
        state = self.state
        if state is not None:
            self.engine.editor.shine(state.name, light)

    def add_light(self) -> None:
        """Add a light above the surface in the middle of the picture, and select it."""
        surface = self.viewport.picking.ground(0.5, 0.5, 0.0)
        if surface is None:
            self.say("no surface in the middle of the picture to put a light above", bad=True)
        else:
            self.selected = self.engine.editor.add_light(
                FIRST_LIGHT, hanging(surface.point, ABOVE_M)
            )

    def copy(self) -> None:
        """Put the selected objects on the clipboard."""
        names = [state.name for state in self.selection.states]
        if names:
            words = f"copied: {listed(names)}"
            self.engine.editor.copy(names, lambda: self.post("copied", lambda: self.say(words)))

    def paste(self) -> None:
        """Add the objects of the clipboard in the middle of the picture, and select them."""
        surface = self.viewport.picking.ground(*MIDDLE, 0.0)

        def pasted(names: Sequence[str]) -> None:
            self.post("pasted", lambda: self.selection.select(*names))

        self.engine.editor.paste(None if surface is None else surface.point, pasted)

    def duplicate(self) -> None:
        """Add a copy of each selected object to its right, and select the copies."""
        self.selection.duplicate(self.viewport.view.world_from_view[:, 0])

    def go_back(self, step: Callable[[], object]) -> None:
        """Undo or redo by a function, and select an object that it brings back."""
        before = self._removed
        step()
        if back := before - self._removed:
            self.selection.select(*sorted(back))

    @property
    def _removed(self) -> set[str]:
        return {edit.name for edit in self.engine.world.edits if edit.removed}

    def add(self, path: Path, x: float, y: float) -> None:
        """Add a mesh on the surface at a position in the picture, and select it.

        Raises
        ------
        IprtError
            There is no such file, or it is not a mesh.
        """
        require_mesh(path)
        if not path.is_file():
            raise IprtError(f"{printable(str(path), 200)}: no such file")
        self.selected = self.engine.editor.add(path, *self.viewport.aim(x, y))

    def save(self) -> None:
        """Write the scene's file."""
        if self.engine.unsaved:
            self.viewport.save(lambda problem: self.post("saved", lambda: self.saved(problem)))
        else:
            self.say("nothing to save")

    def saved(self, problem: str | None) -> None:
        """Report the result of `save`."""
        if problem is None:
            self.say(f"saved to {self.engine.scene.root / 'scene.toml'}")

    def visible(self, name: str) -> bool:
        """Return True if this window shows an object."""
        shown = self.viewport.objects
        return shown is None or name in shown

    def show(self, names: Collection[str], on: bool) -> None:
        """Show or hide objects in this window."""
        known = [state.name for state in self.engine.objects]
        shown = [other for other in known if (on if other in names else self.visible(other))]
        self.viewport.objects = None if shown == known else tuple(shown)

    # The video --------------------------------------------------------------------------------

    @property
    def frames(self) -> range:
        """Numbers of the video's frames."""
        return self.engine.scene.frame_indices

    @property
    def frame(self) -> int:
        """The requested video frame, or the displayed one during playback."""
        return self.viewport.frame

    @property
    def playing(self) -> bool:
        """True while the video plays."""
        return self.engine.playback.playing

    def toggle_playing(self) -> None:
        """Play or pause."""
        if len(self.frames) > 1:
            (self.engine.pause if self.playing else self.engine.play)()


def require_mesh(path: Path) -> None:
    """Raise IprtError if a file is not a mesh, by its name."""
    if path.suffix.lower() not in MESH_SUFFIXES:
        kinds = ", ".join(MESH_SUFFIXES)
        raise IprtError(f"{printable(path.name, 80)}: not a mesh; these are read: {kinds}")
