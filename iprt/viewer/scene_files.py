"""The open scene's files: loading, watching, reloading and saving."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from iprt.errors import IprtError
from iprt.files.text_merge import merged
from iprt.scene.edit_writing import Look, save_edits
from iprt.scene.manifest import MANIFEST_NAME, manifest_text, parse_manifest
from iprt.scene.object_edits import ObjectEdit
from iprt.scene.objects import SceneObject
from iprt.scene.scene import Scene
from iprt.scene.view_edits import views_besides
from iprt.viewer.background_jobs import BackgroundJobs
from iprt.viewer.file_watch import Stamp, Watch
from iprt.viewer.scene_snapshot import EditedScene
from iprt.viewer.shared_state import SharedState

POLL_S = 0.5
"""Polling interval in seconds for changed files."""


@dataclass(frozen=True, eq=False)
class Loaded:
    """A scene with the contents of its files.

    Attributes
    ----------
    scene : Scene
    stamp : Stamp
        Stamp of the files of the frames.
    objects : tuple of SceneObject
        Objects without any edits, saved or not.
    origin : Scene
        The scene from which these objects were read, with the light without any edits.
    text : str
        Text of scene.toml at that time, with later changes by other programs.
    problem : str or None
        Reason for missing objects.
    """

    scene: Scene
    stamp: Stamp
    objects: tuple[SceneObject, ...]
    origin: Scene
    text: str
    problem: str | None = None


class SceneFiles:
    """The scene's files, with background reading; `save` is thread-safe.

    Parameters
    ----------
    scene : Scene
    shared : SharedState
    jobs : BackgroundJobs
    problems : dict of str to str
        Messages by subject, here "scene" and "save".
    clock : callable
        Returns seconds.
    allow_outside : bool
        See `Scene.open`.

    Attributes
    ----------
    loaded : Loaded or None
        None before the first load.
    """

    def __init__(
        self,
        scene: Scene,
        shared: SharedState,
        jobs: BackgroundJobs,
        problems: dict[str, str],
        *,
        clock: Callable[[], float],
        allow_outside: bool,
    ) -> None:
        self._first, self._shared, self._jobs = scene, shared, jobs
        self._problems, self._clock = problems, clock
        self._allow_outside = allow_outside
        self._watch = Watch(scene.root)
        self._polled_s = clock()
        self.loaded: Loaded | None = None
        self._text: str | None = None  # text of scene.toml as last read or written
        self._meshes: dict[Path, Path] = {}  # copies in the scene's folder, by their source

        def first() -> Loaded:
            loaded = load(scene, self._watch.look(), partly=True)
            self._text = loaded.text
            return loaded

        self._read(f"loading {scene.name}", "scene", first)

    @property
    def text(self) -> str | None:
        """Text of scene.toml as last read or written; None before that."""
        return self._text

    def poll(self) -> None:
        """Reload if it is time to look and files have changed."""
        now = self._clock()
        if now - self._polled_s < POLL_S or self._jobs.running:
            return
        self._polled_s = now
        if self._watch.changed():
            self._reread()

    def save(
        self, done: Callable[[str | None], object] = lambda _: None, look: Look | None = None
    ) -> None:
        """Write all edits to the scene's file.

        Parameters
        ----------
        done : callable
            Called with the problem or None, if there was anything to write.
        look : Look or None
            The user's view (`save_edits`).
        """
        world, loaded, shared = self._shared.world, self.loaded, self._shared
        if loaded is None or not world.unsaved:
            return
        kept = True

        def write() -> Loaded:
            nonlocal kept
            here = loaded
            if manifest_text(loaded.scene.root / MANIFEST_NAME) != self._text:
                here, kept = self._again()
            # A file whose changes do not fit includes earlier saved edits, perhaps changed.
            edits = tuple(e for e in world.edits if kept or e not in world.saved)
            known = [e if e.path is None else self._at_home(e, e.path) for e in edits]
            light = world.light if kept else world.light.besides(world.saved_light)
            views = world.views if kept else views_besides(world.views, world.saved_views)
            self._meshes |= save_edits(
                here.origin, known, light=light, views=views, base=here.text, look=look
            )
            now = self._reloaded()
            self._text = now.text
            if not kept:
                return now
            return replace(now, objects=here.objects, origin=here.origin, text=here.text)

        def saved() -> None:
            shared.saved(world)
            if not kept:
                shared.reread()
            done(None)

        self._read(f"saving {loaded.scene.name}", "save", write, saved, done)

    def _at_home(self, edit: ObjectEdit, path: Path) -> ObjectEdit:
        """Return the edit of a new object with its mesh in the scene's folder, once it is there."""
        return replace(edit, path=self._meshes.get(path, path))

    def edited(self) -> EditedScene | None:
        """Return the scene with all present edits; None before the first load."""
        world, loaded = self._shared.world, self.loaded
        if loaded is None:
            return None
        edits = [e if e.path is None else self._at_home(e, e.path) for e in world.edits]
        return EditedScene(loaded.origin, loaded.text, tuple(edits), world.light, world.views)

    def _reread(self) -> None:
        """Reload after another program has written files of the scene."""
        kept = True

        def read() -> Loaded:
            nonlocal kept
            loaded, kept = self._again()
            return loaded

        def then() -> None:
            if not kept:
                self._shared.reread()
                self._meshes.clear()

        self._read(f"loading {self._first.root}", "scene", read, then)

    def _again(self) -> tuple[Loaded, bool]:
        """Reload the files, and apply changes by other programs to the origin.

        Returns
        -------
        (Loaded, bool)
            False if the changes do not fit the origin: then the file itself becomes the origin,
            and saved edits can no longer be undone.
        """
        now, before, ours = self._reloaded(), self.loaded, self._text
        self._text = now.text
        if before is None or ours is None:
            return now, False
        text = merged(before.text, ours, now.text)
        if text is None or text == now.text:
            return now, text is not None
        path = now.scene.root / MANIFEST_NAME
        try:
            origin = Scene(now.scene.root, parse_manifest(text, str(path)), now.scene.within)
            return replace(now, objects=origin.objects, origin=origin, text=text), True
        except IprtError:
            return now, False

    def _reloaded(self) -> Loaded:
        stamp = self._watch.look()
        return load(Scene.open(self._first.root, allow_outside=self._allow_outside), stamp)

    def _read(
        self,
        what: str,
        about: str,
        read: Callable[[], Loaded],
        then: Callable[[], object] = lambda: None,
        otherwise: Callable[[str], object] = lambda _: None,
    ) -> None:
        """Start reading; a failure only adds a message."""

        def job() -> Callable[[], None]:
            loaded = read()

            def finish() -> None:
                self.loaded = loaded
                for solved in {about, "scene"}:
                    self._problems.pop(solved, None)
                if loaded.problem is not None:
                    self._problems["scene"] = loaded.problem
                then()

            return finish

        def fail(problem: str) -> None:
            self._problems[about] = problem
            otherwise(problem)

        self._jobs.start(what, job, fail)


def load(scene: Scene, stamp: Stamp, *, partly: bool = False) -> Loaded:
    """Read everything except frames; `partly` leaves out unreadable objects.

    Raises
    ------
    FormatError
        An object or the metadata of the video cannot be read.
    """
    text, problem = manifest_text(scene.root / MANIFEST_NAME), None
    # Cached by the scene, so that later accesses do not wait for files.
    assert scene.source.white > 0.0
    try:
        objects = scene.objects
        assert scene.declared_materials is not None
    except IprtError as error:
        if not partly:
            raise
        objects, problem = (), str(error)
    return Loaded(scene, stamp, objects, scene, text, problem)
