"""The engine of a viewer: a thread that owns the device, and handles for all others."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from iprt.aovs import AOVS
from iprt.device.compute import ComputeDevice
from iprt.geometry.material import Material
from iprt.measure.tradeoff import Tradeoff, shipped
from iprt.scene.edit import free_name
from iprt.scene.edits import Look, ObjectEdit, flat, require_place
from iprt.scene.scene import Scene
from iprt.scene.stance import Stance
from iprt.settings.model import Settings
from iprt.viewer.core import Core
from iprt.viewer.mailbox import Mailbox
from iprt.viewer.objects import ObjectState
from iprt.viewer.session import Shown
from iprt.viewer.state import Playback, PlaybackMode, Request, Status, World

LEAVING_S = 5.0
"""Longest wait for a thread that is to end: kernels, compilers and decoders cannot be stopped."""


class Client:
    """A client with its own view. Any thread may call any method."""

    def __init__(self, mailbox: Mailbox, request: Request) -> None:
        _require_renderable(request)
        self._mailbox = mailbox
        self._number = mailbox.join(request)

    def ask(self, request: Request) -> int:
        """Want this in place of what was asked for before.

        Returns
        -------
        int
            The number that `Shown.number` reaches with the first picture that answers it.

        Raises
        ------
        ValueError
            A picture without pixels, or an auxiliary picture that there is not.
        """
        _require_renderable(request)
        return self._mailbox.ask(self._number, request)

    @property
    def shown(self) -> Shown | None:
        """The newest picture; None: there is none yet."""
        return self._mailbox.shown(self._number)

    def wait(self, number: int, timeout_s: float) -> Shown | None:
        """The first picture from now on that answers `number`; None: there was none in time."""
        return self._mailbox.wait(self._number, lambda s: s.number >= number, timeout_s)

    def close(self) -> None:
        """Disconnect."""
        self._mailbox.leave(self._number)


class Engine:
    """Renders a scene for any number of clients, newest input first.

    Edits, playback and settings are those of all clients. Any thread may call any method; none
    waits for the device.

    Parameters
    ----------
    scene : Scene
    device : callable
        Makes the device, on the engine's thread; called again when its driver lost it.
    settings : Settings
    clock : callable
        Seconds, which the video plays by.
    allow_outside : bool
        See `Scene.open`.
    tradeoff : Tradeoff or None
        Times of the settings that clients take in motion. None: those of the shipped table.
    """

    def __init__(
        self,
        scene: Scene,
        device: Callable[[], ComputeDevice],
        settings: Settings | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
        allow_outside: bool = False,
        tradeoff: Tradeoff | None = None,
    ) -> None:
        self.tradeoff = tradeoff or shipped()
        self._clock, self._scene = clock, scene
        self._names: set[str] = set()  # of objects that were added; some are not there yet
        playback = Playback(scene.frame_indices[0], loop=scene.manifest.video.loop)
        self._mailbox = Mailbox(World(settings or Settings(), playback), clock)
        self._core = Core(self._mailbox, scene, device, clock=clock, allow_outside=allow_outside)
        self._thread = threading.Thread(target=self._run, name="iprt viewer", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the thread: after the view frame that it renders, or left alone after `LEAVING_S`."""
        until_s = time.monotonic() + LEAVING_S
        self._mailbox.close()
        self._thread.join(LEAVING_S)
        self._core.loader.close(until_s)

    def _run(self) -> None:
        core, mailbox = self._core, self._mailbox
        try:
            while not mailbox.closed:
                try:
                    busy = core.turn()
                except Exception as error:
                    # A defect of ours must not take with it what the user has not saved yet.
                    core.report_defect(error)
                    busy = False
                if not busy:
                    mailbox.rest(core.idle_s)
        finally:
            core.close()

    # What is seen -----------------------------------------------------------------------------

    def client(self, request: Request) -> Client:
        """Another one who looks at the scene.

        Raises
        ------
        ValueError
            As `Client.ask`.
        """
        return Client(self._mailbox, request)

    @property
    def world(self) -> World:
        """The state that all clients share, as requested."""
        return self._mailbox.world

    @property
    def scene(self) -> Scene:
        """The scene as it was read last."""
        return self._core.scene or self._scene

    @property
    def objects(self) -> tuple[ObjectState, ...]:
        """The objects with all edits, where they are in the frame that is shown next.

        Nothing before there is a frame.
        """
        return self._core.objects

    def wanted(self, name: str | None) -> ObjectState | None:
        """One of them with all edits, also those that no picture shows yet; None: not there."""
        state = next((state for state in self.objects if state.name == name), None)
        return None if state is None else state.edited(self.world.edit_of(state.name))

    @property
    def status(self) -> Status:
        return self._mailbox.status

    # The video --------------------------------------------------------------------------------

    @property
    def playing(self) -> bool:
        return self.world.playback.playing

    def play(self) -> int:
        """Go on with the video, from its first frame where it is at its end."""
        frames = self.scene.frame_indices

        def change(playback: Playback) -> Playback:
            at_end = playback.frame >= frames[-1] and not playback.loop
            frame = frames[0] if at_end else playback.frame
            return playback if playback.playing else self._from(playback, frame, playing=True)

        return self._change_playback(change)

    def pause(self) -> int:
        """Stay at the frame that is due now."""
        return self._change_playback(
            lambda playback: self._from(playback, self._position(playback), playing=False)
        )

    def seek(self, frame: int) -> int:
        """Go to a frame, the nearest that there is; a video that plays goes on from there."""
        frames = self.scene.frame_indices
        frame = min(max(frame, frames[0]), frames[-1])
        return self._change_playback(
            lambda playback: self._from(playback, frame, playing=playback.playing)
        )

    @property
    def playback_mode(self) -> PlaybackMode:
        return self.world.playback.mode

    def set_playback_mode(self, mode: PlaybackMode) -> int:
        """Play in real time, or every frame; a video that plays goes on from where it is."""
        return self._change_playback(lambda playback: replace(self._now(playback), mode=mode))

    @property
    def loop(self) -> bool:
        """The video starts again at its end; at first, as the scene says."""
        return self.world.playback.loop

    def set_loop(self, loop: bool) -> int:
        """Start the video again at its end, or not."""
        return self._change_playback(lambda playback: replace(self._now(playback), loop=loop))

    def _change_playback(self, change: Callable[[Playback], Playback]) -> int:
        return self._mailbox.change(lambda world: replace(world, playback=change(world.playback)))

    def _position(self, playback: Playback) -> int:
        """Number of the frame that it has come to."""
        if playback.mode == "every frame":
            return self._core.position(playback)
        scene = self.scene
        due = playback.due(self._clock(), scene.source.fps)
        return playback.index(due, scene.frame_indices)

    def _now(self, playback: Playback) -> Playback:
        """The same, from the frame on that it has come to."""
        return self._from(playback, self._position(playback), playing=playback.playing)

    def _from(self, playback: Playback, frame: int, *, playing: bool) -> Playback:
        return replace(playback, frame=frame, since_s=self._clock() if playing else None)

    # The scene --------------------------------------------------------------------------------

    def set_settings(self, settings: Settings) -> int:
        """Render with other settings, which may make kernels compile."""
        return self._mailbox.change(lambda world: replace(world, settings=settings))

    def place(self, name: str, to_world: NDArray[np.float64]) -> int:
        """Put an object elsewhere; (4, 4), its keyframes move it from there.

        Raises
        ------
        SceneError
            It cannot be there: numbers that are not finite or too large, or that flatten it.
        """
        require_place(name, to_world)
        placed = flat(to_world)
        return self._mailbox.edit(name, lambda edit: replace(edit, to_world=placed))

    def paint(self, name: str, material: Material) -> int:
        """Make an object of another material, all of it."""
        return self._mailbox.edit(name, lambda edit: replace(edit, material=material))

    def remove(self, name: str) -> int:
        """Take an object away."""
        return self._mailbox.edit(name, lambda edit: replace(edit, removed=True))

    def undo(self) -> int:
        """Take the last edit back: a whole gesture, if there was one.

        Edits are undone by who asks, whoever made them, and also those that were saved.
        """
        return self._mailbox.undo()

    def redo(self) -> int:
        """Make the edit again that was undone last, if none was made since."""
        return self._mailbox.redo()

    @property
    def can_undo(self) -> bool:
        """There is an edit to take back."""
        return self._mailbox.can_undo

    @property
    def can_redo(self) -> bool:
        """There is an edit to make again."""
        return self._mailbox.can_redo

    @property
    def unsaved(self) -> tuple[str, ...]:
        """Names of the objects that the scene's file has otherwise."""
        return self.world.unsaved

    def add(
        self,
        path: Path,
        yaw_deg: float,
        pitch_deg: float,
        *,
        stance: Stance | None = None,
        material: Material | None = None,
    ) -> str:
        """Read a mesh, and set it down on the surface seen in a direction, as soon as it is there.

        Parameters
        ----------
        path : Path
        yaw_deg, pitch_deg : float
            In the axes of the capture centre.
        stance : Stance or None
            Which side is up, how far it is turned and how large it is; by default as
            `iprt scene add` without flags.
        material : Material or None
            By default the mesh file's own.

        Returns
        -------
        str
            The name that the object will have. `status` has what goes wrong.
        """
        name = free_name(path.stem, self._core.object_names() | self._names)
        self._names.add(name)
        edit = ObjectEdit(name, material=material, path=path)
        self._core.add(edit, (yaw_deg, pitch_deg), stance or Stance())
        return name

    def save(
        self, done: Callable[[str | None], object] = lambda _: None, look: Look | None = None
    ) -> None:
        """Write all edits to the scene's file, comments and order kept; `status` has problems.

        Parameters
        ----------
        done : callable
            Called by the engine's thread with what went wrong, or None once all is written.
        look : Look or None
            What the user sees: kept as a view of the scene where an object was added that the
            scene's other views do not show (`save_edits`).
        """
        self._core.save(done, look)


def _require_renderable(request: Request) -> None:
    if request.view.width < 1 or request.view.height < 1:
        raise ValueError(f"{request.view}: a picture has at least one pixel")
    if request.frames < 1:
        raise ValueError(f"frames = {request.frames}: at least one is rendered")
    if unknown := set(request.aovs) - set(AOVS):
        raise ValueError(f"there is no auxiliary picture {', '.join(sorted(unknown))}")
