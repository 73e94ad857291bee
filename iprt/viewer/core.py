"""The engine's work, turn by turn; the most urgent work is done first."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from iprt.device.bands import Bands
from iprt.device.compute import ComputeDevice
from iprt.errors import DeviceHangError, DeviceLostError, IprtError, SceneError
from iprt.footage.frame import Frame
from iprt.geometry.meshes import load_mesh
from iprt.scene.mesh_pose import MeshPose
from iprt.scene.object_edits import ObjectEdit, flat
from iprt.scene.objects import SceneObject
from iprt.scene.placement import RealSurfaces, set_down, settled
from iprt.scene.scene import Scene
from iprt.viewer.accumulating_renderer import Stage
from iprt.viewer.background_jobs import BackgroundJobs
from iprt.viewer.compiling import Compiling
from iprt.viewer.object_states import ObjectState
from iprt.viewer.picture_job import PictureJob
from iprt.viewer.plain_video import PlainVideo
from iprt.viewer.scene_files import POLL_S, SceneFiles
from iprt.viewer.scene_light import SceneLight
from iprt.viewer.session import AbandonedError
from iprt.viewer.sessions import Sessions
from iprt.viewer.shared_state import NumberedRequest, SharedState
from iprt.viewer.staging import Staging
from iprt.viewer.state import Doing, Status
from iprt.viewer.video_player import VideoPlayer
from iprt.world.shared import Worlds

LOG = logging.getLogger("iprt.viewer")
Objects = tuple[SceneObject, ...]
NOTE_S = 20.0
"""Duration of notes that the user cannot act on, in seconds."""
MOST_PROGRAMS = 96
"""Limit for cached built programs; a scene needs about 40 at a time."""


class Core:
    """The renderer behind a `SharedState`; all methods are called by one thread.

    Parameters
    ----------
    shared : SharedState
    scene : Scene
    device : callable
        Creates the device; called again after the driver lost it.
    clock : callable
        Returns seconds, on the same clock as the playback's `since_s`.
    allow_outside : bool
        See `Scene.open`.

    Attributes
    ----------
    jobs : BackgroundJobs
    files : SceneFiles
    video : VideoPlayer
    light : SceneLight
    plain : PlainVideo
    """

    def __init__(
        self,
        shared: SharedState,
        scene: Scene,
        device: Callable[[], ComputeDevice],
        *,
        clock: Callable[[], float],
        allow_outside: bool = False,
    ) -> None:
        self._shared, self._make_device, self._clock = shared, device, clock
        self._device: ComputeDevice | None = None
        self._lost = False  # the device was lost since the last picture
        self._compiling = Compiling(self._report_compiling)
        self._problems: dict[str, str] = {}
        self._notes: dict[str, str] = {}
        self._noted_s = 0.0  # time of the newest note on a mesh
        self._under_way: PictureJob | None = None
        self._abandoned = 0  # count of consecutive abandoned pictures
        self.jobs = BackgroundJobs(shared.stir)
        self.files = SceneFiles(
            scene, shared, self.jobs, self._problems, clock=clock, allow_outside=allow_outside
        )
        self.video = VideoPlayer(shared, self._problems, clock)
        self.light = SceneLight(self.jobs, self._problems, clock)
        self.plain = PlainVideo(shared, self.jobs, scene)
        self._staging = Staging(self.files, self.light, self.video)
        self._sessions = Sessions(self._compiling, Worlds())
        self._failed: dict[int, tuple[Stage, NumberedRequest]] = {}
        self._surfaces: tuple[Frame, RealSurfaces] | None = None

    def close(self) -> None:
        """Release all resources; the jobs's threads end by themselves."""
        for session in self._sessions.values():
            session.close()
        self._sessions.clear()
        self.video.close()
        self._release_device()
        self._report("closed")

    # One turn ---------------------------------------------------------------------------------

    def turn(self) -> bool:
        """Do the most urgent work; return True if there was any."""
        collected = self.jobs.collect()
        if self._clock() > self._noted_s + NOTE_S:
            self._problems.pop("mesh", None)
            self._notes.clear()
        self.files.poll()
        wanted = self._shared.take()
        for client in self._sessions.keys() - wanted.requests.keys():
            self._sessions.pop(client).close()
            self._problems.pop(f"client {client}", None)
            self._failed.pop(client, None)
        stage = self._staging.follow(wanted, shown=self._all_see_the_frame(wanted.requests))
        asked = wanted.requests
        chosen = None if stage is None else self._sessions.most_urgent(stage, asked, self._failed)
        if stage is not None:
            self.plain.follow(stage.frame)
        else:
            for client in wanted.requests:
                self.plain.show(client)
        if stage is None or chosen is None:
            missing = stage is None and not self._problems
            self._report("loading" if missing or self.jobs.running else "waiting")
            return collected
        self._render(
            PictureJob(chosen, stage, wanted.requests[chosen], wanted.world, time.perf_counter())
        )
        return True

    @property
    def idle_s(self) -> float:
        """Seconds until the next event, if there is no input."""
        due = self.video.next_due_s
        return POLL_S if due is None else min(max(due - self._clock(), 0.0), POLL_S)

    def _render(self, work: PictureJob) -> None:
        client, stage, asked = work.client, work.stage, work.asked
        session = self._sessions.begin(client)
        problem = f"client {client}"
        self._under_way = work
        try:
            device = self._opened_device()
            shown = session.render(device, stage, asked.number, asked.request)
        except AbandonedError:
            self._abandoned += 1
            self._compiling.finish()
            return
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
            self._lost, self._abandoned = False, 0
            self._problems.pop(problem, None)
            self._failed.pop(client, None)
            self._shared.publish(client, shown)
            self._report("rendering")
        finally:
            self._under_way = None

    def report_defect(self, error: Exception) -> None:
        """Report an internal error; the engine continues."""
        LOG.error("a defect of iprt", exc_info=error)
        self._problems["defect"] = f"a defect of iprt: {type(error).__name__}: {error}"
        self._report("waiting")

    def _give_up(self, client: int, stage: Stage, asked: NumberedRequest, problem: str) -> None:
        """Keep the last good picture until something else is wanted, and report the problem."""
        self._problems[f"client {client}"] = problem
        self._failed[client] = stage, asked
        self._compiling.finish()
        self._report("waiting")

    # The device -------------------------------------------------------------------------------

    def _opened_device(self) -> ComputeDevice:
        if self._device is None:
            self._device = device = self._make_device()
            device.building = self._compiles
            device.bands = Bands(device.wait, self._go_on)
            device.most_programs = MOST_PROGRAMS
        return self._device

    def _release_device(self) -> None:
        """Detach from the device, which others may still use, so that nothing is abandoned."""
        device, self._device = self._device, None
        if device is not None:
            device.building, device.bands, device.most_programs = lambda _: None, None, None

    def _drop_device(self) -> None:
        for session in self._sessions.values():
            session.close()
        self._release_device()

    def _compiles(self, file: str) -> None:
        """Report that the device is about to compile, which cannot be interrupted."""
        self._go_on()
        self._compiling.begin(file)
        work = self._under_way
        if work is not None:
            self.plain.show(work.client)

    def _go_on(self) -> None:
        """Raise `AbandonedError` if the picture under way is obsolete."""
        work = self._under_way
        if work is None:
            return
        if self._shared.closed or work.unwanted(self._shared.snapshot, self._abandoned):
            raise AbandonedError

    def _report_compiling(self) -> None:
        self._report("rendering" if self._compiling.file is None else "compiling")

    def _report(self, doing: Doing) -> None:
        compiling, what = self._compiling, ""
        if doing == "rendering" and self.jobs.running:
            doing = "loading"  # pictures are seen to be rendered
        if doing == "compiling":
            what = compiling.file or ""
        elif doing == "loading":
            what = ", ".join(self.jobs.running)
        counts = (compiling.built, compiling.to_build) if doing == "compiling" else (0, 0)
        lines = tuple(self._problems.values()), tuple(self._notes.values())
        self._shared.report(Status(doing, what, *lines, *counts))

    # The world --------------------------------------------------------------------------------

    def _all_see_the_frame(self, clients: Iterable[int]) -> bool:
        """Return True if every client, except failed ones, has seen the frame of the video."""
        stage, failed = self._staging.stage, self._failed
        return stage is not None and all(
            client in failed or (client in self._sessions and self._sessions[client].shows(stage))
            for client in clients
        )

    # What else is read and written beside -----------------------------------------------------

    @property
    def objects(self) -> tuple[ObjectState, ...]:
        """Objects of the newest stage; readable from any thread."""
        return self._staging.objects

    @property
    def ready(self) -> bool:
        """True if the newest stage has the frame and all edits; readable from any thread."""
        stage, world, scene = self._staging.stage, self._shared.world, self.scene
        if stage is None or scene is None or self._staging.edits != world.edits:
            return False
        playback = world.playback
        return playback.playing or stage.frame.index == playback.index(0, scene.frame_indices)

    def problem_of(self, client: int | None = None) -> str | None:
        """Return why a client gets no picture, or without one why no frame comes; None if it will.

        It can be called from any thread.
        """
        problems = dict(self._problems)
        if self._staging.stage is None:
            return next(iter(problems.values()), None)
        return problems.get(f"client {client}")

    @property
    def scene(self) -> Scene | None:
        """The scene as last read, or None before that."""
        loaded = self.files.loaded
        return None if loaded is None else loaded.scene

    def object_names(self) -> set[str]:
        """Return the names of the scene's objects and of added ones."""
        loaded = self.files.loaded
        objects = () if loaded is None else loaded.objects
        edits = self._shared.world.edits
        return {entry.name for entry in objects} | {edit.name for edit in edits}

    def add(
        self,
        edit: ObjectEdit,
        direction: tuple[float, float],
        pose: MeshPose,
        done: Callable[[str | None], object] = lambda _: None,
    ) -> None:
        """Load the mesh of `edit.path`, and place it in a direction (yaw, pitch) in degrees.

        `done` is called with the problem, or None after success.
        """
        path, frame = edit.path, self.video.frame
        assert path is not None

        def job() -> Callable[[], None]:
            mesh = load_mesh(path)
            if frame is None:
                raise SceneError(f"{path}: there is no frame yet to set it down in")
            placed = set_down(self._surfaces_of(frame), mesh, *direction, pose)
            to_world = placed.to_world
            if frame.pose is not None:
                to_world = frame.pose @ to_world
            added = replace(edit, to_world=flat(to_world), mesh=mesh)

            def finish() -> None:
                self._problems.pop("mesh", None)
                unread = [f"not read: {', '.join(mesh.dropped)}"] if mesh.dropped else []
                if notes := [*placed.warnings(), *mesh.warnings, *unread]:
                    self._notes[path.name] = f"{path.name}: {'; '.join(notes)}"
                    self._noted_s = self._clock()
                self._shared.edit(lambda world: world.having(added))
                done(None)

            return finish

        def report(problem: str) -> None:
            # Files that browsers upload lie in the server's temporary folder.
            self.note_problem(problem.replace(str(path), path.name))
            done(problem)

        self.jobs.start(f"loading {path.name}", job, report)

    def settle(self, states: Sequence[ObjectState], align: bool) -> None:
        """Move objects vertically onto the real surface below each; see `SceneEditor.settle`."""
        frame = self.video.frame

        def job() -> Callable[[], None]:
            if frame is None:
                raise SceneError("there is no frame yet to set objects down in")
            surfaces, places = self._surfaces_of(frame), {}
            pose = np.eye(4) if frame.pose is None else frame.pose
            for state in states:
                seen = np.linalg.inv(pose) @ state.to_world
                to_world = settled(surfaces, state.name, state.mesh, seen, align=align)
                places[state.name] = flat(state.placed(pose @ to_world))

            def finish() -> None:
                self._shared.edit(
                    lambda world: reduce(
                        lambda edited, name: edited.edited(name, to_world=places[name]),
                        places,
                        world,
                    )
                )

            return finish

        self.jobs.start("looking for the surface below", job, self.note_problem)

    def _surfaces_of(self, frame: Frame) -> RealSurfaces:
        """Return the real surfaces of a frame; called by jobs."""
        known = self._surfaces
        if known is None or known[0] is not frame:
            self._surfaces = known = frame, RealSurfaces(frame)
        return known[1]

    def note_problem(self, problem: str) -> None:
        """Show a problem for a while; only the engine's thread may call it."""
        self._problems["mesh"] = problem
        self._noted_s = self._clock()
