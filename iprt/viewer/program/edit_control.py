"""The methods by which programs edit a scene in a viewer."""

from __future__ import annotations

import time
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import numpy as np

from iprt.errors import IprtError
from iprt.files.message_text import printable
from iprt.scene.edit_writing import Look as SavedLook
from iprt.scene.mesh_pose import MeshPose
from iprt.viewer.autosaver import Offer
from iprt.viewer.pose_parts import moved, resized, turned
from iprt.viewer.program.arguments import (
    Look,
    Matrix,
    Pitch,
    Positive,
    Vector,
    Yaw,
    material_of,
)
from iprt.viewer.program.checked import checked
from iprt.viewer.program.control_base import LOADING_S, ControlBase
from iprt.viewer.program.pictures import wait_ready, wait_until
from iprt.viewer.ui_state import require_mesh


class EditControl(ControlBase):
    """Editing by a program; see `Control`."""

    # Objects ----------------------------------------------------------------------------------

    @checked
    def add(
        self,
        mesh: Path,
        *,
        yaw: Yaw | None = None,
        pitch: Pitch | None = None,
        up: str = "y",
        rotate: float = 0.0,
        height: Positive | None = None,
        unit: Positive | None = None,
        material: Look | None = None,
    ) -> str:
        """Add a mesh on the surface in a direction, and return its name once it is there.

        Parameters
        ----------
        mesh : path
        yaw, pitch : float, optional
            Direction in degrees; by default the middle of the picture.
        up : {"x", "-x", "y", "-y", "z", "-z"}
            The file's axis that points up.
        rotate : float
            Rotation about the vertical in degrees, counter-clockwise from above.
        height : float, optional
            Height in metres.
        unit : float, optional
            Metres of one unit of the file. Without height and unit, the longest side becomes a
            fifth of the distance.
        material : str or dict, optional
            Words as of `iprt scene add --material`, or a table as in scene.toml; by default the
            file's own.
        """
        require_mesh(mesh)
        if not mesh.is_file():
            raise IprtError(f"{printable(str(mesh), 200)}: no such file")
        pose = MeshPose(up, rotate, height, unit)
        painted = None if material is None else material_of(material)
        until_s = time.monotonic() + LOADING_S
        wait_ready(self._engine, until_s)
        view, done = self._windows.seen.view, Future[str | None]()
        name = self._engine.editor.add(
            mesh.absolute(),
            view.yaw_deg if yaw is None else yaw,
            view.pitch_deg if pitch is None else pitch,
            pose=pose,
            material=painted,
            done=done.set_result,
        )
        self._finish(done, until_s, str(mesh))
        start = self._windows.start
        if start.objects is not None:
            self._windows.begin(replace(start, objects=(*start.objects, name)))
        self._everywhere(lambda ui: ui.viewport.poll())  # shows what was added
        return name

    @checked
    def place(
        self,
        name: str,
        position: Vector | None = None,
        *,
        rotation: Vector | None = None,
        size: Positive | None = None,
        to_world: Matrix | None = None,
    ) -> None:
        """Move an object; omitted values stay.

        Parameters
        ----------
        name : str
        position : (3,) floats, optional
            Centre of the bottom of its box, or a light's place, in the world in metres.
        rotation : (3,) floats, optional
            Rotations about X, Y and Z in degrees; Z is applied first, Y last.
        size : float, optional
            Longest side of its box in metres.
        to_world : (4, 4) or 16 floats, optional
            Transform from the mesh to the world, in the current frame. It replaces the others.
        """
        state = self._state(name)
        if to_world is not None:
            if not (position is None and rotation is None and size is None):
                raise IprtError("place: to_world says all; leave out the others")
            matrix = np.reshape(np.array(to_world), (4, 4))
            self._engine.editor.place({name: state.placed(matrix)})
            return
        if size is not None:
            state = replace(state, to_world=resized(state, size))
        if rotation is not None:
            state = replace(state, to_world=turned(state, rotation))
        if position is not None:
            state = replace(state, to_world=moved(state, position))
        self._engine.editor.place({name: state.placed(state.to_world)})

    @checked
    def paint(self, name: str, material: Look) -> None:
        """Give an object another material.

        Parameters
        ----------
        name : str
        material : str or dict
            Words as of `iprt scene add --material`, or a table as in scene.toml.
        """
        if self._state(name).light is not None:
            raise IprtError(f"paint: {name} is a light without a surface")
        self._engine.editor.paint({name: material_of(material)})

    @checked
    def remove(self, name: str) -> None:
        """Remove an object."""
        self._engine.editor.remove([self._state(name).name])

    @checked
    def show(self, name: str, on: bool = True) -> None:
        """Show or hide an object in all windows."""
        self._state(name)
        start, names = self._windows.start, [state.name for state in self._objects()]
        before = names if start.objects is None else start.objects
        after = tuple(n for n in names if (on if n == name else n in before))
        begin = replace(start, objects=None if len(after) == len(names) else after)
        self._windows.begin(begin)
        self._everywhere(lambda ui: ui.show(name, on))

    # Edits ------------------------------------------------------------------------------------

    @checked
    def undo(self) -> None:
        """Undo the last edit, of any window or program."""
        self._engine.undo()

    @checked
    def redo(self) -> None:
        """Redo the last undone edit."""
        self._engine.redo()

    @checked
    def restore(self) -> list[str]:
        """Restore the newest unsaved edits that an earlier viewer of the scene left.

        Returns
        -------
        list of str
            Names of the objects, and keys of `[video]`; empty if there are none.
        """
        until_s = time.monotonic() + LOADING_S
        offer, done = self._offer(until_s), Future[str | None]()
        if offer is None:
            return []
        self._engine.autosaver.restore(done.set_result)
        self._finish(done, until_s, "restore")
        return list(offer.names)

    @checked
    def discard(self) -> list[str]:
        """Delete the edits that `restore` would restore, and return the same names."""
        offer = self._offer(time.monotonic() + LOADING_S)
        self._engine.autosaver.discard()
        return [] if offer is None else list(offer.names)

    def _offer(self, until_s: float) -> Offer | None:
        autosaver = self._engine.autosaver
        wait_until(self._engine, lambda: autosaver.looked, until_s, "unsaved edits")
        return autosaver.offer

    @checked
    def save(self) -> None:
        """Write all edits to the scene's file."""
        if not self._engine.unsaved:
            return
        until_s = time.monotonic() + LOADING_S
        wait_ready(self._engine, until_s)
        seen, done = self._windows.seen, Future[str | None]()
        names = tuple(state.name for state in self._objects() if self._shows(state))
        everything = len(names) == len(self._objects())
        self._engine.save(done.set_result, SavedLook(seen.view, None if everything else names))
        self._finish(done, until_s, "save")
