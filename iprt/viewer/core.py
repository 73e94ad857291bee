"""The engine's work, one turn after another: what is most urgent is done first."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import replace

from iprt.device.compute import ComputeDevice
from iprt.errors import DeviceHangError, DeviceLostError, IprtError, SceneError
from iprt.film import footage_of
from iprt.scene.edits import ObjectEdit, edited_objects, flat
from iprt.scene.footage import Footage
from iprt.scene.frame import Frame
from iprt.scene.meshes import load_mesh
from iprt.scene.objects import SceneObject, objects_at
from iprt.scene.placement import RealSurfaces, bounds, set_down
from iprt.scene.scene import Scene
from iprt.settings import Settings
from iprt.viewer.canvas import Stage
from iprt.viewer.exchange import Asked, Exchange, Wanted
from iprt.viewer.feed import Feed
from iprt.viewer.files import POLL_S, Loaded, SceneFiles
from iprt.viewer.loading import Loader
from iprt.viewer.objects import ObjectState, object_states
from iprt.viewer.session import Session
from iprt.viewer.state import Doing, Playback, World

LOG = logging.getLogger("iprt.viewer")
TOLD_S = 20.0
"""So long it is told that a mesh cannot be read: nothing that the user does would solve that."""


class Core:
    """Renders what an `Exchange` is asked for. All methods are called by one thread.

    Parameters
    ----------
    exchange : Exchange
    scene : Scene
    device : callable
        Makes the device; called again when its driver lost it.
    clock : callable
        Seconds; the playback's `since_s` are of its kind.
    allow_outside : bool
        See `Scene.open`.

    Attributes
    ----------
    objects : tuple of ObjectState
        Of the newest stage; any thread may look.
    """

    def __init__(
        self,
        exchange: Exchange,
        scene: Scene,
        device: Callable[[], ComputeDevice],
        *,
        clock: Callable[[], float],
        allow_outside: bool = False,
    ) -> None:
        self._exchange, self._make_device, self._clock = exchange, device, clock
        self._device: ComputeDevice | None = None
        self._lost = False  # the device, since the last picture
        self._compiling: str | None = None
        self._problems: dict[str, str] = {}
        self._told_s = 0.0  # when the last mesh could not be read
        self.loader = Loader(exchange.stir)
        self._files = SceneFiles(
            scene,
            exchange,
            self.loader,
            self._problems,
            clock=clock,
            allow_outside=allow_outside,
        )
        self._feed: Feed | None = None
        self._fed: Loaded | None = None  # whose video that is
        self._unreadable: Playback | None = None  # its frame cannot be read
        self._frame: Frame | None = None
        self._settled = 0  # number of the last change of which all that it asks for is there
        self._objects: tuple[Loaded, tuple[ObjectEdit, ...], tuple[SceneObject, ...]] | None = None
        self._footage: tuple[Loaded, Settings, Footage] | None = None
        self._stage: Stage | None = None
        self.objects: tuple[ObjectState, ...] = ()
        self._sessions: dict[int, Session] = {}
        self._failed: dict[int, tuple[Stage, Asked]] = {}
        self._turns: dict[int, int] = {}
        self._turn = 0

    def close(self) -> None:
        """Release all; the loader's threads end by themselves."""
        for session in self._sessions.values():
            session.close()
        self._sessions.clear()
        if self._feed is not None:
            self._feed.close()
        self._tell("closed")

    # One turn ---------------------------------------------------------------------------------

    def turn(self) -> bool:
        """Do what is most urgent; whether there was anything to do."""
        collected = self.loader.collect()
        if self._clock() > self._told_s + TOLD_S:
            self._problems.pop("mesh", None)
        self._files.poll()
        wanted = self._exchange.take()
        for client in self._sessions.keys() - wanted.requests.keys():
            self._sessions.pop(client).close()
            self._problems.pop(f"client {client}", None)
            self._failed.pop(client, None)
        stage = self._staged(wanted)
        chosen = None if stage is None else self._most_urgent(stage, wanted.requests)
        if stage is None or chosen is None:
            missing = stage is None and not self._problems
            self._tell("loading" if missing or self.loader.running else "waiting")
            return collected
        self._render(chosen, stage, wanted.requests[chosen])
        return True

    @property
    def idle_s(self) -> float:
        """Seconds that nothing will happen by itself."""
        due = None if self._feed is None else self._feed.next_due_s
        return POLL_S if due is None else min(max(due - self._clock(), 0.0), POLL_S)

    def _most_urgent(self, stage: Stage, requests: Mapping[int, Asked]) -> int | None:
        """Who is to get a picture: first who waits for something new, then who can be refined;
        among those, who has waited longest. None: nobody.
        """
        ranked = []
        for client, asked in requests.items():
            if self._failed.get(client) == (stage, asked):
                continue
            session = self._sessions.setdefault(client, Session(self._report_compiling))
            behind = session.behind(stage, asked.number)
            if behind or session.unrefined(asked.request):
                ranked.append((not behind, self._turns.get(client, 0), client))
        return min(ranked)[-1] if ranked else None

    def _render(self, client: int, stage: Stage, asked: Asked) -> None:
        self._turn += 1
        self._turns[client] = self._turn
        session = self._sessions[client]
        problem = f"client {client}"
        try:
            device = self._opened_device()
            shown = session.render(device, stage, asked.number, asked.request)
        except DeviceLostError as error:
            self._drop_device()
            if not self._lost:
                LOG.warning("%s: starting again in a new context", error)
                self._lost = True
                return
            self._give_up(client, stage, asked, f"{error}, for the second time")
        except DeviceHangError as error:
            self._drop_device()
            self._give_up(client, stage, asked, str(error))
        except IprtError as error:
            session.close()
            self._give_up(client, stage, asked, str(error))
        except Exception as error:
            session.close()
            self.report_defect(error)
            self._give_up(client, stage, asked, self._problems.pop("defect"))
        else:
            self._lost = False
            self._problems.pop(problem, None)
            self._failed.pop(client, None)
            self._exchange.publish(client, shown)
            self._tell("rendering")

    def report_defect(self, error: Exception) -> None:
        """Tell of an error that no input should lead to, on whose account nothing need end."""
        LOG.error("a defect of iprt", exc_info=error)
        self._problems["defect"] = f"a defect of iprt: {type(error).__name__}: {error}"
        self._tell("waiting")

    def _give_up(self, client: int, stage: Stage, asked: Asked, problem: str) -> None:
        """Until something else is wanted: the last good picture stays."""
        self._problems[f"client {client}"] = problem
        self._failed[client] = stage, asked
        self._compiling = None
        self._tell("waiting")

    # The device -------------------------------------------------------------------------------

    def _opened_device(self) -> ComputeDevice:
        if self._device is None:
            self._device = self._make_device()
            self._device.building = self._report_compiling
        return self._device

    def _drop_device(self) -> None:
        for session in self._sessions.values():
            session.close()
        self._device = None

    def _report_compiling(self, file: str | None) -> None:
        self._compiling = file
        self._tell("rendering" if file is None else "compiling")

    def _tell(self, doing: Doing) -> None:
        what = (self._compiling or "") if doing == "compiling" else ""
        if doing == "loading":
            what = ", ".join(self.loader.running)
        self._exchange.tell(
            replace(
                self._exchange.status,
                doing=doing,
                what=what,
                problems=tuple(self._problems.values()),
            )
        )

    # The world --------------------------------------------------------------------------------

    def _staged(self, wanted: Wanted) -> Stage | None:
        """What there is to see now; None: nothing yet."""
        loaded = self._files.loaded
        if loaded is None:
            return None
        world = wanted.world
        self._follow_video(loaded, world)
        frame = self._frame
        if frame is None:
            return None
        objects = self._edited(loaded, world)
        footage = self._footage_of(loaded, frame, world.settings)
        assert self._feed is not None
        if self._feed.arrived or self._unreadable == world.playback:
            self._settled = wanted.number
        known = self._stage
        if known is not None and known.number == self._settled:
            parts = (known.frame, known.objects, known.footage, known.settings)
            if all(
                a is b
                for a, b in zip(parts, (frame, objects, footage, world.settings), strict=True)
            ):
                return known
        time_s = loaded.scene.time_of(frame.index)
        instances = objects_at(objects, time_s)
        self.objects = object_states(objects, instances, time_s, self.objects)
        self._stage = Stage(self._settled, frame, objects, instances, footage, world.settings)
        return self._stage

    def _follow_video(self, loaded: Loaded, world: World) -> None:
        scene, playback = loaded.scene, world.playback
        drift = world.settings.drift and len(scene.frame_indices) > 1
        if (
            self._feed is None
            or self._fed is None
            or self._feed.drift != drift
            or not self._fed.same_video(loaded)
        ):
            if self._feed is not None:
                self._feed.close()
            self._feed = Feed(
                scene, playback, drift=drift, clock=self._clock, wake=self._exchange.stir
            )
            self._fed, self._unreadable = loaded, None
        self._feed.follow(playback, None if self._frame is None else self._frame.index)
        if self._unreadable == playback:
            return
        try:
            frame = self._feed.poll()
        except IprtError as error:
            self._problems["video"] = str(error)
            self._unreadable = playback
            return
        if frame is not None:
            self._frame = frame
            self._problems.pop("video", None)
        self._stop_at_the_end(scene, playback)

    def _stop_at_the_end(self, scene: Scene, playback: Playback) -> None:
        """A video that has come to its end rests: its last frame is refined, at its best."""
        if playback.since_s is None or scene.manifest.video.loop or self._frame is None:
            return
        frames = scene.frame_indices
        last = frames[-1]
        due = playback.index(playback.due(self._clock(), scene.source.fps), frames, loop=False)
        if due == self._frame.index == last:
            self._exchange.change(
                lambda world: replace(
                    world, playback=Playback(last) if world.playback == playback else world.playback
                )
            )

    def _edited(self, loaded: Loaded, world: World) -> tuple[SceneObject, ...]:
        known = self._objects
        if known is None or known[0] is not loaded or known[1] != world.edits:
            edited = edited_objects(loaded.objects, world.edits)
            self._objects = known = (loaded, world.edits, edited)
        return known[2]

    def _footage_of(self, loaded: Loaded, frame: Frame, settings: Settings) -> Footage:
        """What the video's frames may have, told by the first one that was shown."""
        known = self._footage
        if known is None or known[0] is not loaded or known[1] != settings:
            several = len(loaded.scene.frame_indices) > 1
            footage = footage_of(loaded.scene, frame, settings) if several else Footage.of(frame)
            self._footage = known = (loaded, settings, footage)
        return known[2]

    # What else is read and written beside -----------------------------------------------------

    @property
    def scene(self) -> Scene | None:
        """The scene as it was read last; None: not yet."""
        loaded = self._files.loaded
        return None if loaded is None else loaded.scene

    def object_names(self) -> set[str]:
        """Those of the scene's objects, and of those that were added."""
        loaded = self._files.loaded
        objects = () if loaded is None else loaded.objects
        edits = self._exchange.world.edits
        return {entry.name for entry in objects} | {edit.name for edit in edits}

    def add(self, edit: ObjectEdit, direction: tuple[float, float], height: float | None) -> None:
        """Read the mesh of `edit.path` and set it down where (yaw, pitch) in degrees points."""
        path, frame = edit.path, self._frame
        assert path is not None

        def job() -> Callable[[], None]:
            mesh = load_mesh(path)
            if frame is None:
                raise SceneError(f"{path}: there is no frame yet to set it down in")
            to_world = set_down(RealSurfaces(frame), bounds(mesh), *direction, height)
            if frame.pose is not None:
                to_world = frame.pose @ to_world
            added = replace(edit, to_world=flat(to_world), mesh=mesh)

            def finish() -> None:
                self._problems.pop("mesh", None)
                self._exchange.edit(added.name, lambda _: added)

            return finish

        self.loader.start(str(path), job, self._tell_of_mesh)

    def save(self, done: Callable[[str | None], object] = lambda _: None) -> None:
        """Write all edits to the scene's file, and go on with what that says then."""
        self._files.save(done)

    def _tell_of_mesh(self, problem: str) -> None:
        self._problems["mesh"], self._told_s = problem, self._clock()
